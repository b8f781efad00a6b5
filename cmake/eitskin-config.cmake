include(${CMAKE_CURRENT_LIST_DIR}/eitskin-targets.cmake)
