# Flags that every target shares, and the function that turns a folder into a layer of the library.

set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/bin)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
if(NOT CMAKE_BUILD_TYPE AND NOT CMAKE_CONFIGURATION_TYPES)
  set(CMAKE_BUILD_TYPE Release)
endif()

# Arithmetic. Contraction would make forward and backward disagree by an ulp (docs/numerics.md); errno and trapping
# semantics stand in the way of vector code and change no result. Never fast-math: isfinite must keep working.
add_library(hsi4d_arithmetic INTERFACE)
add_library(hsi4d::arithmetic ALIAS hsi4d_arithmetic)
set_target_properties(hsi4d_arithmetic PROPERTIES EXPORT_NAME arithmetic)
target_compile_options(hsi4d_arithmetic INTERFACE -ffp-contract=off -fno-math-errno -fno-trapping-math)
target_compile_features(hsi4d_arithmetic INTERFACE cxx_std_20)

option(HSI4D_UNITY "Compile a room's source files together" ON)
# Clang takes a precompiled header only with the very flags that it was made with; kernels have others.
set(hsi4d_precompile OFF)
if(HSI4D_UNITY AND CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  set(hsi4d_precompile ON)
endif()

# What makes a second build or a link shorter is used where it is found.
if(NOT DEFINED CMAKE_CXX_COMPILER_LAUNCHER)
  find_program(HSI4D_CCACHE ccache)
  mark_as_advanced(HSI4D_CCACHE)
  if(HSI4D_CCACHE)
    set(CMAKE_CXX_COMPILER_LAUNCHER ${CMAKE_COMMAND} -E env CCACHE_SLOPPINESS=pch_defines,time_macros ${HSI4D_CCACHE})
    if(hsi4d_precompile)
      add_compile_options(-fpch-preprocess)  # without it ccache does not see the precompiled header
    endif()
  endif()
endif()
find_program(HSI4D_LINKER NAMES ld.mold ld.lld)
mark_as_advanced(HSI4D_LINKER)
if(HSI4D_LINKER)
  cmake_path(GET HSI4D_LINKER EXTENSION LAST_ONLY linker)
  string(SUBSTRING ${linker} 1 -1 linker)
  add_link_options(-fuse-ld=${linker})
endif()

# g++ collects its garbage less often: 3 to 8 % less time for a fifth more memory, 1.7 GiB at most.
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  add_compile_options(--param=ggc-min-expand=400 --param=ggc-min-heapsize=524288)
endif()

# Warnings: ours alone, never those of a project that uses us. (-Wrestrict misfires on std::string in g++ 12, PR 105651; -Wmaybe-uninitialized
# on std::regex under sanitizers.)
if(HSI4D_SANITIZE)
  set(hsi4d_sanitizer_warnings $<$<CXX_COMPILER_ID:GNU>:-Wno-maybe-uninitialized>)
endif()
if(HSI4D_UNITY)  # a source file that is included: what it keeps to itself is no fault of a header
  set(hsi4d_unity_warnings $<$<CXX_COMPILER_ID:GNU>:-Wno-subobject-linkage>)
endif()
add_library(hsi4d_warnings INTERFACE)
target_compile_options(hsi4d_warnings INTERFACE -Wall -Wextra -Wpedantic -Wshadow -Wnon-virtual-dtor -Wconversion
                                                -Wno-sign-conversion -Wno-psabi $<$<CXX_COMPILER_ID:GNU>:-Wno-restrict>
                                                "$<$<CXX_COMPILER_ID:Clang>:-Wno-unknown-pragmas;-Wno-bitwise-instead-of-logical>"
                                                ${hsi4d_sanitizer_warnings} ${hsi4d_unity_warnings}
                                                $<$<BOOL:${HSI4D_WARNINGS_AS_ERRORS}>:-Werror>)

# Left out: what only tells earlier what would crash anyway (null, alignment), vptr and object-size. With them a large test
# file took 61 s to compile instead of 38.
if(HSI4D_SANITIZE)
  add_compile_options(-fsanitize=${HSI4D_SANITIZE} -fno-omit-frame-pointer -fno-sanitize-recover=all
                      -fno-sanitize=null,alignment,vptr,object-size)
  add_link_options(-fsanitize=${HSI4D_SANITIZE})
endif()

# What libFuzzer steers by is in every layer: each reads files, or is read with. Kernels are compiled as they are, and for one
# instruction set: no reader runs them, and clang 14 took a quarter of an hour for the one of SSIM.
if(HSI4D_BUILD_FUZZERS)
  if(NOT CMAKE_CXX_COMPILER_ID MATCHES "Clang")
    message(FATAL_ERROR "HSI4D_BUILD_FUZZERS needs clang: -DCMAKE_CXX_COMPILER=clang++")
  endif()
  add_compile_options(-fsanitize=fuzzer-no-link)
  add_compile_definitions(HWY_COMPILE_ONLY_STATIC)
  file(GLOB kernels ${PROJECT_SOURCE_DIR}/*/*_kernel.cpp ${PROJECT_SOURCE_DIR}/*/*/*_kernel.cpp)
  set_source_files_properties(${kernels} PROPERTIES COMPILE_OPTIONS -fno-sanitize=all)
endif()

# The level of optimisation of the rooms that are added next. It counts in Release alone.
set(hsi4d_level O2)

# Files with vector code are compiled with -O3 and each by itself; all others with the level of their room and, where unity
# builds are on, a room at once, so that a header is read once a room. AddressSanitizer does not watch scopes there: vectors
# are many short-lived variables, and block_kernel.cpp took 92 s to compile instead of 42.
set(hsi4d_vector_code "foreach_target|on_best_isa|with_best_lanes|autodiff/map\\.h")

# cmake/headers.h is compiled once a level: g++ gives functions of other targets, and all others of a file, the level that
# the precompiled header was made with (with that of -O2, rasterize was 1.2 to 1.5 times slower).
function(hsi4d_add_headers level)
  set(target hsi4d_headers_${level})
  add_library(${target} OBJECT ${PROJECT_SOURCE_DIR}/cmake/headers.cpp)
  target_link_libraries(${target} PRIVATE hsi4d::arithmetic hsi4d_warnings Eigen3::Eigen)
  set_target_properties(${target} PROPERTIES POSITION_INDEPENDENT_CODE ON)
  target_compile_options(${target} PRIVATE $<$<CONFIG:Release>:-${level}>)
  target_precompile_headers(${target} PRIVATE ${PROJECT_SOURCE_DIR}/cmake/headers.h)
endfunction()

# hsi4d_set_sources(TARGET SOURCE...): how the source files of a library are compiled.
function(hsi4d_set_sources target)
  set_target_properties(${target} PROPERTIES UNITY_BUILD ${HSI4D_UNITY} UNITY_BUILD_BATCH_SIZE 0)
  target_compile_options(${target} PRIVATE $<$<CONFIG:Release>:-${hsi4d_level}>)
  if(hsi4d_precompile)
    target_precompile_headers(${target} REUSE_FROM hsi4d_headers_${hsi4d_level})
  endif()
  set(header ${PROJECT_BINARY_DIR}/CMakeFiles/hsi4d_headers_O3.dir/cmake_pch.hxx)
  foreach(source ${ARGN})
    file(STRINGS ${source} found REGEX "${hsi4d_vector_code}" LIMIT_COUNT 1)
    if(found)
      set_property(SOURCE ${source} PROPERTY SKIP_UNITY_BUILD_INCLUSION ON)
      set_property(SOURCE ${source} APPEND PROPERTY COMPILE_OPTIONS $<$<CONFIG:Release>:-O3>)
      if("${HSI4D_SANITIZE}" MATCHES "address")
        set_property(SOURCE ${source} APPEND PROPERTY COMPILE_OPTIONS -fno-sanitize-address-use-after-scope)
      endif()
      if(hsi4d_precompile AND NOT HSI4D_SANITIZE)
        set_property(SOURCE ${source} PROPERTY SKIP_PRECOMPILE_HEADERS ON)
        set_property(SOURCE ${source} APPEND PROPERTY COMPILE_OPTIONS -include ${header})
        set_property(SOURCE ${source} APPEND PROPERTY OBJECT_DEPENDS ${header}.gch)
      endif()
    endif()
  endforeach()
endfunction()

# hsi4d_add_room(PATH [TOP] [APART] [DEPENDS room...] [LINK target...] [PRIVATE_LINK target...])
# Every source file of folder PATH becomes the static library hsi4d_PATH; a new file needs no edit here. TOP: the files
# of the folder itself, not those of the rooms in it; the library is hsi4d_PATH_top. APART: each source file is always compiled by itself, so that it sees no
# name of another.
function(hsi4d_add_room path)
  cmake_parse_arguments(PARSE_ARGV 1 arg "TOP;APART" "" "DEPENDS;LINK;PRIVATE_LINK")
  string(REPLACE "/" "_" name ${path})
  set(glob GLOB_RECURSE)
  if(arg_TOP)
    set(glob GLOB)
    string(APPEND name "_top")
  endif()
  file(${glob} sources CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/${path}/*.cpp)
  list(FILTER sources EXCLUDE REGEX "(/main|_module)\\.cpp$")
  list(TRANSFORM arg_DEPENDS REPLACE "/" "_")
  list(TRANSFORM arg_DEPENDS PREPEND hsi4d::)
  add_library(hsi4d_${name} STATIC ${sources})
  add_library(hsi4d::${name} ALIAS hsi4d_${name})
  set_target_properties(hsi4d_${name} PROPERTIES EXPORT_NAME ${name} POSITION_INDEPENDENT_CODE ON)
  target_link_libraries(hsi4d_${name} PUBLIC hsi4d::arithmetic ${arg_DEPENDS} ${arg_LINK}
                                      PRIVATE $<BUILD_INTERFACE:hsi4d_warnings> ${arg_PRIVATE_LINK})
  target_include_directories(hsi4d_${name} PUBLIC
    $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}>
    $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>
    $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}/hsi4d>)
  hsi4d_set_sources(hsi4d_${name} ${sources})
  if(arg_APART)
    set_target_properties(hsi4d_${name} PROPERTIES UNITY_BUILD OFF)
  endif()
  set_property(GLOBAL APPEND PROPERTY HSI4D_LAYERS hsi4d_${name})
endfunction()

# hsi4d_add_module(NAME SOURCE ROOM LINK...): libhsi4d_NAME.so from one file, SOURCE_module.cpp, which alone sees the
# libraries that it links to. The room loads it when it is first needed (core/loaded_library.h); programs find it by
# their run path.
function(hsi4d_add_module name source room)
  add_library(hsi4d_${name} MODULE ${PROJECT_SOURCE_DIR}/${source}_module.cpp)
  set_target_properties(hsi4d_${name} PROPERTIES PREFIX lib
                                                 LIBRARY_OUTPUT_DIRECTORY ${CMAKE_RUNTIME_OUTPUT_DIRECTORY})
  target_include_directories(hsi4d_${name} PRIVATE ${PROJECT_SOURCE_DIR})
  target_link_libraries(hsi4d_${name} PRIVATE ${ARGN} hsi4d_warnings)
  add_dependencies(hsi4d_${room} hsi4d_${name})
  set_property(GLOBAL APPEND PROPERTY HSI4D_MODULES hsi4d_${name})
endfunction()

# hsi4d_find_modules(ROOM): programs that link the room look for modules beside themselves, or where they are installed.
function(hsi4d_find_modules room)
  target_link_libraries(hsi4d_${room} PRIVATE ${CMAKE_DL_LIBS})
  # An old run path counts for libraries that others open in the program's name too, as sanitizers do.
  target_link_options(hsi4d_${room} INTERFACE
    LINKER:--disable-new-dtags
    $<BUILD_INTERFACE:LINKER:-rpath,${CMAKE_RUNTIME_OUTPUT_DIRECTORY}>
    $<INSTALL_INTERFACE:LINKER:-rpath,$<INSTALL_PREFIX>/${CMAKE_INSTALL_LIBDIR}>)
endfunction()

# hsi4d_add_layer(NAME ROOM...): hsi4d::NAME, all its rooms.
function(hsi4d_add_layer name)
  list(TRANSFORM ARGN REPLACE "/" "_" OUTPUT_VARIABLE rooms)
  list(TRANSFORM rooms PREPEND hsi4d::)
  add_library(hsi4d_${name} INTERFACE)
  add_library(hsi4d::${name} ALIAS hsi4d_${name})
  set_target_properties(hsi4d_${name} PROPERTIES EXPORT_NAME ${name})
  target_link_libraries(hsi4d_${name} INTERFACE ${rooms})
  set_property(GLOBAL APPEND PROPERTY HSI4D_LAYERS hsi4d_${name})
endfunction()

# hsi4d_add_program(NAME MAIN ROOM): the program NAME.
function(hsi4d_add_program name main room)
  add_executable(${name} ${PROJECT_SOURCE_DIR}/${main})
  target_link_libraries(${name} PRIVATE ${room} hsi4d_warnings)
endfunction()

# The Python module hsi4d, from folder python/, in python/ of the build. It is left out, which is told, where something
# that it needs is missing: the python3 of the system, its headers, pybind11.
function(hsi4d_add_python)
  find_program(HSI4D_PYTHON3 python3 HINTS /usr/bin)  # the one that Debian's NumPy belongs to
  mark_as_advanced(HSI4D_PYTHON3)
  set(Python_EXECUTABLE ${HSI4D_PYTHON3})
  find_package(Python 3.9 COMPONENTS Interpreter Development.Module QUIET)
  find_package(pybind11 2.10 CONFIG QUIET)
  if(NOT Python_FOUND OR NOT pybind11_FOUND)
    message(STATUS "Python's headers or pybind11 are missing: the Python module is not built")
    return()
  endif()
  file(GLOB sources CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/python/*.cpp)
  pybind11_add_module(hsi4d_python MODULE NO_EXTRAS ${sources})
  target_link_libraries(hsi4d_python PRIVATE hsi4d::pipelines_sweep hsi4d_warnings)
  target_compile_options(hsi4d_python PRIVATE $<$<CONFIG:Release>:-O1>)
  target_link_options(hsi4d_python PRIVATE LINKER:--exclude-libs,ALL)
  set_target_properties(hsi4d_python PROPERTIES OUTPUT_NAME hsi4d LIBRARY_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/python
                                                UNITY_BUILD ${HSI4D_UNITY} UNITY_BUILD_BATCH_SIZE 0
                                                INSTALL_RPATH "$ORIGIN/..")
  configure_file(${PROJECT_SOURCE_DIR}/python/hsi4d.pyi ${PROJECT_BINARY_DIR}/python/hsi4d.pyi COPYONLY)
endfunction()

# Configs that commands write or begin with become part of the program, so that it runs from anywhere.
function(hsi4d_embed_configs)
  set(HSI4D_SHIPPED_CONFIGS "")
  foreach(name best demo demo_quick from_video avatar/from_run)
    set(file ${PROJECT_SOURCE_DIR}/configs/${name}.json)
    set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${file})
    file(READ ${file} text)
    string(APPEND HSI4D_SHIPPED_CONFIGS "{\"${name}.json\", R\"json(${text})json\"},\n          ")
  endforeach()
  configure_file(${PROJECT_SOURCE_DIR}/cmake/shipped_configs.cpp.in ${PROJECT_BINARY_DIR}/generated/shipped_configs.cpp @ONLY)
  target_sources(hsi4d_pipelines_config PRIVATE ${PROJECT_BINARY_DIR}/generated/shipped_configs.cpp)
endfunction()

# The report's style and scripts, in the order in which they need each other, become part of the library.
function(hsi4d_embed_report_assets)
  set(folder ${PROJECT_SOURCE_DIR}/pipelines/report/assets)
  set(HSI4D_REPORT_SCRIPTS "")
  foreach(name timeline compare plots view3d_data view3d_draw view3d start)
    file(READ ${folder}/${name}.js script)
    string(APPEND HSI4D_REPORT_SCRIPTS "R\"hsi4d(${script})hsi4d\", ")
    set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${folder}/${name}.js)
  endforeach()
  file(READ ${folder}/report.css HSI4D_REPORT_CSS)
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${folder}/report.css)
  configure_file(${PROJECT_SOURCE_DIR}/cmake/report_assets.cpp.in ${PROJECT_BINARY_DIR}/generated/report_assets.cpp @ONLY)
  target_sources(hsi4d_pipelines_report PRIVATE ${PROJECT_BINARY_DIR}/generated/report_assets.cpp)
endfunction()

# hsi4d_embed_page(ROOM): style, HTML and script of a room's page, likewise.
function(hsi4d_embed_page room)
  string(TOUPPER ${room} name)
  foreach(kind css html js)
    string(TOUPPER ${kind} part)
    set(file ${PROJECT_SOURCE_DIR}/pipelines/${room}/assets/${room}.${kind})
    file(READ ${file} HSI4D_${name}_${part})
    set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${file})
  endforeach()
  configure_file(${PROJECT_SOURCE_DIR}/cmake/${room}_assets.cpp.in ${PROJECT_BINARY_DIR}/generated/${room}_assets.cpp @ONLY)
  target_sources(hsi4d_pipelines_${room} PRIVATE ${PROJECT_BINARY_DIR}/generated/${room}_assets.cpp)
endfunction()

# Compiler and flags, which measurements tell beside their times.
function(hsi4d_embed_flags)
  string(TOUPPER "${CMAKE_BUILD_TYPE}" type)
  get_target_property(arithmetic hsi4d_arithmetic INTERFACE_COMPILE_OPTIONS)
  get_directory_property(everywhere COMPILE_OPTIONS)
  list(JOIN arithmetic " " arithmetic)
  list(JOIN everywhere " " everywhere)
  string(REGEX REPLACE " +" " " flags "${CMAKE_CXX_FLAGS} ${CMAKE_CXX_FLAGS_${type}} ${everywhere} ${arithmetic}")
  string(STRIP "${flags}" flags)
  if(type STREQUAL RELEASE)
    string(APPEND flags " (vector code: -O3)")
  endif()
  set_property(SOURCE bench/machine.cpp APPEND PROPERTY COMPILE_DEFINITIONS
               HSI4D_COMPILER="${CMAKE_CXX_COMPILER_ID} ${CMAKE_CXX_COMPILER_VERSION}" HSI4D_FLAGS="${flags}")
endfunction()

# hsi4d_find_commit(OUT): the commit that is checked out, or "unknown" where the source is not the top of a git checkout.
# A commit configures the build anew.
function(hsi4d_find_commit out)
  set(${out} unknown PARENT_SCOPE)
  find_program(HSI4D_GIT git)
  mark_as_advanced(HSI4D_GIT)
  if(NOT HSI4D_GIT)
    return()
  endif()
  execute_process(COMMAND ${HSI4D_GIT} rev-parse --show-prefix --path-format=absolute --git-path logs/HEAD
                          --short=12 HEAD
                  WORKING_DIRECTORY ${PROJECT_SOURCE_DIR} RESULT_VARIABLE status OUTPUT_VARIABLE answer ERROR_QUIET)
  # Three lines: the folder within the checkout (empty at its top), the file that grows with every commit, the commit.
  if(status EQUAL 0 AND answer MATCHES "^\n([^\n]+)\n([0-9a-f]+)\n$")
    set(${out} ${CMAKE_MATCH_2} PARENT_SCOPE)
    if(EXISTS ${CMAKE_MATCH_1})
      set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${CMAKE_MATCH_1})
    endif()
  endif()
endfunction()

# The commit in a header, looked at in every build: changes that are not committed are told by "-modified" behind it.
function(hsi4d_embed_commit)
  hsi4d_find_commit(commit)
  set(header ${PROJECT_BINARY_DIR}/generated/commit/hsi4d_commit.h)
  add_custom_target(hsi4d_commit BYPRODUCTS ${header} VERBATIM
    COMMAND ${CMAKE_COMMAND} "-DGIT=$<$<BOOL:${HSI4D_GIT}>:${HSI4D_GIT}>" -DSOURCE=${PROJECT_SOURCE_DIR}
                             -DCOMMIT=${commit} -DHEADER=${header} -P ${PROJECT_SOURCE_DIR}/cmake/write_commit.cmake)
  add_dependencies(hsi4d_core hsi4d_commit)
  set_property(SOURCE core/version.cpp APPEND PROPERTY COMPILE_DEFINITIONS HSI4D_VERSION="${PROJECT_VERSION}")
  set_property(SOURCE core/version.cpp APPEND PROPERTY COMPILE_OPTIONS -include ${header})
  set_property(SOURCE core/version.cpp APPEND PROPERTY OBJECT_DEPENDS ${header})
endfunction()
