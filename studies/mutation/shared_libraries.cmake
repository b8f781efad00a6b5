# The libraries that studies/mutation/mutate_c.py changes are shared ones here, all of their names visible:
# a changed one takes the place of the sound one, and no test is linked again.
set(CMAKE_C_COMPILE_OPTIONS_VISIBILITY "-DVISIBILITY=")
macro(add_library name)
    set(arguments ${ARGN})
    if("${name}" MATCHES "^(eitskin_f32|eitskin_f64|fw_app)$")
        list(TRANSFORM arguments REPLACE "^STATIC$" "SHARED")
    endif()
    _add_library(${name} ${arguments})
endmacro()
set(CMAKE_POSITION_INDEPENDENT_CODE ON)
