# eitskin_add_core(NAME [DOUBLE]): the C core as a static library, in single or double width.
#
# Contraction and re-association stay off: kernels say fma where they mean it, and the bits must not depend on the target.

set(EITSKIN_CORE_SOURCES
    types.c model.c load.c kernels.c columns.c kernels_portable.c context.c stages.c baseline.c frame.c floor.c observed.c map.c
    electrodes.c glitch.c quiet.c misfit.c solve.c certificate.c fista.c
    working_set.c coordinate.c active_set.c missing.c factor.c disc.c coupling.c fit.c keep.c regroup.c touch.c crowded.c track.c batch.c self_test.c link.c)

set(EITSKIN_WARNINGS -Wall -Wextra -Wconversion -Wdouble-promotion -Werror)
set(EITSKIN_ARITHMETIC -fno-fast-math -ffp-contract=off -fno-math-errno) # in this order: the first resets the last

function(eitskin_add_core name)
    cmake_parse_arguments(CORE "DOUBLE" "" "" ${ARGN})
    set(root ${PROJECT_SOURCE_DIR}/csrc)
    list(TRANSFORM EITSKIN_CORE_SOURCES PREPEND ${root}/src/ OUTPUT_VARIABLE sources)
    add_library(${name} STATIC ${sources})
    target_include_directories(${name} PUBLIC ${root}/include PRIVATE ${root}/src)
    target_compile_options(${name} PRIVATE ${EITSKIN_WARNINGS} ${EITSKIN_ARITHMETIC})
    set_target_properties(${name} PROPERTIES C_VISIBILITY_PRESET hidden)
    if(CORE_DOUBLE)
        target_compile_definitions(${name} PUBLIC EITS_DOUBLE)
    endif()
    if(EITSKIN_AVX2)
        target_sources(${name} PRIVATE ${root}/src/kernels_avx2.c)
        set_source_files_properties(${root}/src/kernels_avx2.c PROPERTIES COMPILE_OPTIONS "-mavx2;-mfma;-mf16c")
        target_compile_definitions(${name} PRIVATE EITS_BUILD_AVX2)
    endif()
    if(EITSKIN_M7)
        target_sources(${name} PRIVATE ${root}/src/kernels_m7.c)
        target_compile_definitions(${name} PRIVATE EITS_BUILD_M7)
    endif()
    if(NOT CMAKE_SYSTEM_NAME STREQUAL "Generic")
        set_target_properties(${name} PROPERTIES POSITION_INDEPENDENT_CODE ON)
    endif()
    if(UNIX AND NOT CMAKE_SYSTEM_NAME STREQUAL "Generic")
        target_link_libraries(${name} PUBLIC m)
    endif()
endfunction()
