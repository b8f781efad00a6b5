/* A plugin of QEMU that counts instructions: QEMU ... -plugin libcount.so writes their number to
 * count.txt when the program ends. Debian has no qemu-plugin.h, so that what is used of it is
 * declared here. */
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

typedef uint64_t plugin_id;
typedef struct qemu_plugin_tb block;
extern void qemu_plugin_register_vcpu_tb_trans_cb(plugin_id id, void (*call)(plugin_id, block *));
extern size_t qemu_plugin_tb_n_insns(const block *translated);
extern void qemu_plugin_register_vcpu_tb_exec_inline(block *translated, int operation, void *number,
                                                     uint64_t added);
extern void qemu_plugin_register_atexit_cb(plugin_id id, void (*call)(plugin_id, void *),
                                           void *own);

enum { ADD = 0 };

int qemu_plugin_version = 1;
int qemu_plugin_install(plugin_id id, const void *info, int count, char **word);

static uint64_t total;

static void add_up(plugin_id id, block *translated)
{
    (void)id;
    qemu_plugin_register_vcpu_tb_exec_inline(translated, ADD, &total,
                                             qemu_plugin_tb_n_insns(translated));
}

static void write_total(plugin_id id, void *own)
{
    (void)id;
    (void)own;
    FILE *file = fopen("count.txt", "w");
    if (file != NULL) {
        fprintf(file, "%llu\n", (unsigned long long)total);
        fclose(file);
    }
}

int qemu_plugin_install(plugin_id id, const void *info, int count, char **word)
{
    (void)info;
    (void)count;
    (void)word;
    qemu_plugin_register_vcpu_tb_trans_cb(id, add_up);
    qemu_plugin_register_atexit_cb(id, write_total, NULL);
    return 0;
}
