# What the library links to; the same file serves the build and the installed package. All are Debian 12 packages.
# OpenImageIO and libzip come through pkg-config: Debian's CMake files of both insist on command-line tools
# that are in other packages.
include(CMakeFindDependencyMacro)
find_dependency(PkgConfig)
find_dependency(Eigen3)
find_dependency(TBB)
find_dependency(OpenEXR)
find_dependency(PNG)
find_dependency(nlohmann_json)
find_dependency(spdlog)
find_dependency(hwy)
pkg_check_modules(OpenImageIO REQUIRED IMPORTED_TARGET OpenImageIO)
pkg_check_modules(libzip REQUIRED IMPORTED_TARGET libzip)
