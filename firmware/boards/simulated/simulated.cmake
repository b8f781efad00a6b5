# fw_simulated: the application before simulated parts, for the host (python/eitskin/device).
add_library(fw_simulated STATIC ${CMAKE_CURRENT_SOURCE_DIR}/boards/simulated/simulated.c)
target_include_directories(fw_simulated PUBLIC ${CMAKE_CURRENT_SOURCE_DIR}/boards/simulated)
target_link_libraries(fw_simulated PUBLIC fw_app)
target_compile_options(fw_simulated PRIVATE ${EITSKIN_WARNINGS} ${EITSKIN_ARITHMETIC})
if(EITSKIN_PYTHON) # the core in it keeps -O3
    target_compile_options(fw_app PRIVATE -O2)
endif()
set_target_properties(fw_simulated PROPERTIES POSITION_INDEPENDENT_CODE ON
                      C_VISIBILITY_PRESET hidden)
