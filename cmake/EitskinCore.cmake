# eitskin_add_core(NAME [DOUBLE]): the C core as a static library, in single or double width.
#
# Contraction and re-association stay off: kernels say fma where they mean it, and the bits must not depend on the target.

set(EITSKIN_CORE_SOURCES
    base/arithmetic.c base/cholesky.c base/status.c base/texts.c
    kernels/kernels.c kernels/portable.c
    model/model.c model/options.c model/force.c model/row_form.c model/uncertainty.c model/scan_order.c
    context/column_cache.c context/products.c context/triangle.c
    context/projection.c context/places.c frame/reference.c frame/places.c frame/fold.c frame/regularisation.c frame/whitening.c
    frame/whitening_products.c frame/rows_out.c frame/reference_tracking.c
    diagnostics/electrodes.c diagnostics/outliers.c diagnostics/model_mismatch.c
    diagnostics/crowded.c diagnostics/reference_outliers.c diagnostics/second_moment.c
    solve/solve.c solve/duality_gap.c solve/fista.c solve/working_set.c
    solve/active_set.c solve/violations.c solve/active_columns.c
    touch/disc.c touch/interaction.c touch/disc_fit.c touch/prune.c touch/split_merge.c touch/seek.c
    touch/touch.c
    evidence/covariance.c evidence/shape.c evidence/likelihood.c evidence/verdict.c
    evidence/elimination.c evidence/touch_test.c
    evidence/confidence.c evidence/pair.c
    multipole/taylor.c multipole/form.c multipole/induced.c multipole/rows.c joint/metric.c joint/prior.c joint/kinds.c joint/fit.c joint/settle.c joint/merge.c joint/split.c joint/search.c joint/report.c joint/begin.c
    api/setup.c api/access.c api/save.c api/frame_stage.c api/reference.c api/reconstruct.c
    api/touches.c api/batch.c api/draw.c api/self_test.c
    fast/setup.c fast/rows.c fast/bias.c fast/tracks.c fast/map.c fast/ring.c fast/path.c
    fast/frames.c fast/report.c fast/trust.c search/fit.c search/equations.c search/known.c
    search/births.c search/list.c search/decide.c search/apply.c
    gesture/plane.c gesture/one_finger.c gesture/two_fingers.c gesture/gesture.c gesture/zones.c
    link/link.c)

set(EITSKIN_WARNINGS -Wall -Wextra -Wconversion -Wdouble-promotion)
if(EITSKIN_WERROR)
    list(APPEND EITSKIN_WARNINGS -Werror)
endif()
set(EITSKIN_ARITHMETIC -fno-fast-math -ffp-contract=off -fno-math-errno) # in this order: the first resets the last
if(EITSKIN_PYTHON) # nothing unwinds through C; a tenth of the modules
    list(APPEND EITSKIN_ARITHMETIC -fno-asynchronous-unwind-tables)
endif()

function(eitskin_add_core name)
    cmake_parse_arguments(CORE "DOUBLE" "" "" ${ARGN})
    set(root ${PROJECT_SOURCE_DIR}/csrc)
    list(TRANSFORM EITSKIN_CORE_SOURCES PREPEND ${root}/src/ OUTPUT_VARIABLE sources)
    add_library(${name} STATIC ${sources})
    target_include_directories(
        ${name} PUBLIC $<BUILD_INTERFACE:${root}/include> $<INSTALL_INTERFACE:include>
        PRIVATE ${root}/src)
    target_compile_options(${name} PRIVATE ${EITSKIN_WARNINGS} ${EITSKIN_ARITHMETIC})
    target_compile_definitions(${name} PRIVATE EITS_CONTRACTION_OFF)
    set_target_properties(${name} PROPERTIES C_VISIBILITY_PRESET hidden)
    if(CORE_DOUBLE)
        target_compile_definitions(${name} PUBLIC EITS_DOUBLE)
        # only what compares with it waits for it; -O3 takes a third more room and a quarter more time to compile
        target_compile_options(${name} PRIVATE $<$<CONFIG:Release>:-O2>)
    endif()
    if(EITSKIN_AVX2)
        target_sources(${name} PRIVATE ${root}/src/kernels/avx2.c)
        set_source_files_properties(${root}/src/kernels/avx2.c PROPERTIES COMPILE_OPTIONS "-mavx2;-mfma;-mf16c")
        target_compile_definitions(${name} PRIVATE EITS_BUILD_AVX2)
    endif()
    if(EITSKIN_M7)
        target_sources(${name} PRIVATE ${root}/src/kernels/m7.c)
        target_compile_definitions(${name} PRIVATE EITS_BUILD_M7)
    endif()
    if(NOT CMAKE_SYSTEM_NAME STREQUAL "Generic")
        set_target_properties(${name} PROPERTIES POSITION_INDEPENDENT_CODE ON)
    endif()
    if(UNIX AND NOT CMAKE_SYSTEM_NAME STREQUAL "Generic")
        target_link_libraries(${name} PUBLIC m)
    endif()
endfunction()
