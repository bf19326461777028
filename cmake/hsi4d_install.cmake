# `cmake --install`: headers under include/hsi4d, static libraries, the program, and a package for find_package(hsi4d).
include(CMakePackageConfigHelpers)

get_property(layers GLOBAL PROPERTY HSI4D_LAYERS)
list(FILTER layers EXCLUDE REGEX "_(bench|stress)$")  # no part of the library
install(TARGETS ${layers} hsi4d_arithmetic EXPORT hsi4d_targets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
foreach(folder core autodiff splat body optim pipelines)
  install(DIRECTORY ${PROJECT_SOURCE_DIR}/${folder} DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/hsi4d FILES_MATCHING PATTERN "*.h")
endforeach()
get_property(modules GLOBAL PROPERTY HSI4D_MODULES)
install(TARGETS ${modules} LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR})
set_target_properties(hsi4d hsi4d-bench hsi4d-stress PROPERTIES INSTALL_RPATH "$ORIGIN/../${CMAKE_INSTALL_LIBDIR}")
install(TARGETS hsi4d hsi4d-bench hsi4d-stress RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
if(TARGET hsi4d_python)
  install(TARGETS hsi4d_python LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR}/python)
  install(FILES ${PROJECT_SOURCE_DIR}/python/hsi4d.pyi DESTINATION ${CMAKE_INSTALL_LIBDIR}/python)
endif()
install(DIRECTORY ${PROJECT_SOURCE_DIR}/configs DESTINATION ${CMAKE_INSTALL_DATADIR}/hsi4d)
# The front end, where the program looks for it (front_end_places).
install(PROGRAMS ${PROJECT_SOURCE_DIR}/tools/frontend DESTINATION ${CMAKE_INSTALL_DATADIR}/hsi4d/tools)
install(FILES ${PROJECT_SOURCE_DIR}/tools/common.sh DESTINATION ${CMAKE_INSTALL_DATADIR}/hsi4d/tools)
foreach(name blazepose hands track)
  install(FILES ${PROJECT_SOURCE_DIR}/tools/services/${name}.mjs DESTINATION ${CMAKE_INSTALL_DATADIR}/hsi4d/tools/services)
endforeach()

set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/hsi4d)
install(EXPORT hsi4d_targets NAMESPACE hsi4d:: DESTINATION ${package_dir})
configure_package_config_file(${PROJECT_SOURCE_DIR}/cmake/hsi4d-config.cmake.in ${PROJECT_BINARY_DIR}/hsi4d-config.cmake
                              INSTALL_DESTINATION ${package_dir})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/hsi4d-config-version.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/hsi4d-config.cmake ${PROJECT_BINARY_DIR}/hsi4d-config-version.cmake
              ${PROJECT_SOURCE_DIR}/cmake/hsi4d_dependencies.cmake DESTINATION ${package_dir})
