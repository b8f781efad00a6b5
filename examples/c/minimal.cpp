// The same as minimal.c in C++. Use: minimal_cpp MODEL.eitm
#include <eitskin/eitskin.h>

#include <fstream>
#include <iostream>
#include <iterator>
#include <stdexcept>
#include <string>
#include <vector>

namespace
{

struct alignas(16) Block {
    unsigned char bytes[16];
};

void check(const std::string &what, eits_status status)
{
    if (status != EITS_OK)
        throw std::runtime_error(what + ": " + eits_status_text(status));
}

// The bytes of a file, aligned as a model has to be.
std::vector<Block> read_file(const std::string &path, std::size_t &size)
{
    std::ifstream file(path, std::ios::binary);
    if (!file)
        throw std::runtime_error(path + ": cannot be read");
    const std::string bytes{std::istreambuf_iterator<char>(file), {}};
    size = bytes.size();
    std::vector<Block> blob((size + 15) / 16);
    bytes.copy(reinterpret_cast<char *>(blob.data()), size);
    return blob;
}

void print_touches(const std::string &path)
{
    std::size_t size = 0;
    const std::vector<Block> blob = read_file(path, size);
    eits_model model;
    check(path, eits_model_open(&model, blob.data(), size));

    std::vector<Block> workspace((eits_workspace_size(&model, 1) + 15) / 16);
    eits_context *skin = nullptr;
    check("workspace", eits_init(workspace.data(), 16 * workspace.size(), &model, &skin));

    const float *golden = model.golden.reference;
    const std::vector<eits_real> reference(golden, golden + model.n_rows);
    const std::vector<eits_real> frame(model.golden.frame, model.golden.frame + model.n_rows);
    check("reference", eits_reference_set(skin, reference.data(), reference.size()));
    check("frame", eits_reconstruct(skin, frame.data(), frame.size(), nullptr, nullptr));
    std::vector<eits_touch> touches(EITS_MAX_TOUCHES);
    std::uint32_t count = 0;
    check("touches", eits_find_touches(skin, touches.data(), EITS_MAX_TOUCHES, &count));
    touches.resize(count);
    for (const eits_touch &touch : touches)
        std::cout << "touch " << touch.id << ": (" << touch.x_mm << ", " << touch.y_mm
                  << ") mm, radius " << touch.radius_mm << " mm\n";
}

} // namespace

int main(int argc, char **argv)
{
    if (argc != 2) {
        std::cerr << "use: minimal_cpp MODEL.eitm\n";
        return 2;
    }
    try {
        print_touches(argv[1]);
    } catch (const std::exception &error) {
        std::cerr << error.what() << "\n";
        return 1;
    }
    return 0;
}
