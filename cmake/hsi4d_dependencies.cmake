# What the library links to; the same file serves the build and the installed package. All are Debian 12 packages.
# OpenImageIO and libzip come through pkg-config: Debian's CMake files of both insist on command-line tools
# that are in other packages.
include(CMakeFindDependencyMacro)
# In the build itself no find_package(hsi4d) stands behind this: a missing library has to stop it here, by name.
if(NOT CMAKE_FIND_PACKAGE_NAME)
  set(CMAKE_FIND_PACKAGE_NAME hsi4d)
  set(hsi4d_FIND_REQUIRED TRUE)
endif()
find_dependency(PkgConfig)
find_dependency(Eigen3)
find_dependency(TBB)
find_dependency(OpenEXR)
find_dependency(PNG)
find_dependency(ZLIB)
find_dependency(nlohmann_json)
find_dependency(spdlog)
find_dependency(hwy)
find_dependency(nanoflann)
find_dependency(TinyGLTF CONFIG)
pkg_check_modules(OpenImageIO REQUIRED IMPORTED_TARGET OpenImageIO)
pkg_check_modules(libturbojpeg REQUIRED IMPORTED_TARGET libturbojpeg)
pkg_check_modules(libzip REQUIRED IMPORTED_TARGET libzip)
pkg_check_modules(libzstd REQUIRED IMPORTED_TARGET libzstd)
