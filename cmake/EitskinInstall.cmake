# `cmake --install`: headers, static libraries, find_package(eitskin) and pkg-config.
#
#   eitskin::core     the core in float, as a microcontroller runs it   libeitskin_f32.a
#   eitskin::core64   the core in double                                libeitskin_f64.a
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

set(package ${CMAKE_INSTALL_LIBDIR}/cmake/eitskin)
set_target_properties(eitskin_f32 PROPERTIES EXPORT_NAME core)
set_target_properties(eitskin_f64 PROPERTIES EXPORT_NAME core64)

install(TARGETS eitskin_f32 eitskin_f64 EXPORT eitskin-targets COMPONENT core
        ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(DIRECTORY csrc/include/eitskin DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT core)
install(EXPORT eitskin-targets NAMESPACE eitskin:: DESTINATION ${package} COMPONENT core)

write_basic_package_version_file(
    ${PROJECT_BINARY_DIR}/eitskin-config-version.cmake COMPATIBILITY SameMinorVersion)
install(FILES cmake/eitskin-config.cmake ${PROJECT_BINARY_DIR}/eitskin-config-version.cmake
        DESTINATION ${package} COMPONENT core)

# from the .pc files to the prefix, which `cmake --install --prefix` may choose
file(RELATIVE_PATH EITSKIN_PC_UP "/${CMAKE_INSTALL_LIBDIR}/pkgconfig" "/")
foreach(name eitskin eitskin64)
    set(EITSKIN_PC_NAME ${name})
    set(EITSKIN_PC_LIBRARY eitskin_f32)
    set(EITSKIN_PC_CFLAGS "")
    if(name STREQUAL "eitskin64")
        set(EITSKIN_PC_LIBRARY eitskin_f64)
        set(EITSKIN_PC_CFLAGS " -DEITS_DOUBLE")
    endif()
    configure_file(cmake/eitskin.pc.in ${PROJECT_BINARY_DIR}/${name}.pc @ONLY)
    install(FILES ${PROJECT_BINARY_DIR}/${name}.pc
            DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig COMPONENT core)
endforeach()
