# The images: eitskin_BOARD.elf and its map for each board, and .bin for those that are flashed. The same sources and compiler
# give the same bytes wherever they are built. SCRIPT and SOURCES name files of other boards.
function(eitskin_add_image board)
    cmake_parse_arguments(IMAGE "FLASHED" "SCRIPT" "SPECS;LIBRARIES;SOURCES" ${ARGN})
    set(name eitskin_${board})
    set(folder ${CMAKE_CURRENT_SOURCE_DIR}/boards/${board})
    set(script ${folder}/${board}.ld)
    if(IMAGE_SCRIPT)
        set(script ${CMAKE_CURRENT_SOURCE_DIR}/boards/${IMAGE_SCRIPT})
    endif()
    file(GLOB sources CONFIGURE_DEPENDS ${folder}/*.c)
    list(TRANSFORM IMAGE_SOURCES PREPEND ${CMAKE_CURRENT_SOURCE_DIR}/boards/)
    add_executable(${name} ${sources} ${IMAGE_SOURCES})
    target_link_libraries(${name} PRIVATE fw_app ${IMAGE_LIBRARIES})
    target_compile_options(${name} PRIVATE ${EITSKIN_WARNINGS} ${EITSKIN_ARITHMETIC} -ffile-prefix-map=${PROJECT_SOURCE_DIR}=.)
    target_link_options(${name} PRIVATE -nostartfiles ${IMAGE_SPECS} -T${script} -Wl,--gc-sections -Wl,--fatal-warnings
                        -Wl,-Map=${CMAKE_CURRENT_BINARY_DIR}/${name}.map)
    set_target_properties(${name} PROPERTIES SUFFIX .elf LINK_DEPENDS ${script})
    add_custom_command(TARGET ${name} POST_BUILD COMMAND arm-none-eabi-size $<TARGET_FILE:${name}>)
    if(IMAGE_FLASHED)
        add_custom_command(TARGET ${name} POST_BUILD COMMAND ${CMAKE_OBJCOPY} -O binary $<TARGET_FILE:${name}> ${name}.bin
                           BYPRODUCTS ${name}.bin)
    endif()
endfunction()

eitskin_add_image(nucleo_f767zi FLASHED SPECS --specs=nano.specs --specs=nosys.specs)
eitskin_add_image(mps2_an500 SPECS --specs=rdimon.specs LIBRARIES m)
eitskin_add_image(example SCRIPT mps2_an500/mps2_an500.ld SPECS --specs=nosys.specs LIBRARIES m
                  SOURCES mps2_an500/capture.c mps2_an500/timebase.c)
