# cmake -DROOT=source tree -DSCRATCH=folder -P layering_test.cmake
# Fails when an #include of the source tree breaks the rule of the layers; before that, proves on made-up trees that each
# kind of offence is found, and that nothing else is.
cmake_minimum_required(VERSION 3.25)
include(${CMAKE_CURRENT_LIST_DIR}/layering.cmake)

# Characters that CMake's lists cannot carry, for the made-up files.
set(open "[")
set(semicolon ";")

# expect(TITLE FILES… ERRORS…): a tree of FILES (path, text, path, text, …) has exactly these ERRORS.
function(expect title)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "" "FILES;ERRORS")
  file(REMOVE_RECURSE ${SCRATCH})
  while(arg_FILES)
    list(POP_FRONT arg_FILES path text)
    string(CONFIGURE "${text}" text @ONLY)
    file(WRITE ${SCRATCH}/${path} "${text}")
  endwhile()
  find_layering_errors(found ${SCRATCH})
  if(NOT "${found}" STREQUAL "${arg_ERRORS}")
    list(JOIN found "\n  " found)
    list(JOIN arg_ERRORS "\n  " wanted)
    message(FATAL_ERROR "The layering check itself is wrong (${title}).\nExpected:\n  ${wanted}\nFound:\n  ${found}")
  endif()
endfunction()

expect("a tree that keeps the rule"
  FILES core/a.h "#pragma once\n#include <vector>\n"
        core/a.cpp "#include \"core/a.h\"\n#include <nlohmann/json.hpp>\n#include <core>\n"
        autodiff/b.h "// #include \"pipelines/cli/d.h\"\n#include \"core/a.h\"\n"
        splat/c.cpp "int x@open@]@semicolon@ /* @semicolon@ */\n#include \"autodiff/b.h\"\n"
        pipelines/cli/d.h "  #  include \"core/a.h\"\n#include \"splat/c.cpp\"\n")
expect("an upward include"
  FILES core/a.h "#pragma once\n\n#include \"autodiff/b.h\"\n" autodiff/b.h ""
  ERRORS "core/a.h:3: \"autodiff/b.h\" is not allowed: core may include core")
expect("indented, behind a bracket and a separator, in a folder of a folder"
  FILES body/deep/a.cpp "int x@open@@semicolon@\n  # include  \"optim/b.h\"  // why\n" optim/b.h ""
  ERRORS "body/deep/a.cpp:2: \"optim/b.h\" is not allowed: body may include core, autodiff, body")
expect("a room above, in the same layer"
  FILES splat/a.h "#include \"splat/render/b.h\"\n" splat/render/b.h "#include \"splat/a.h\"\n"
        splat/files/c.h "#include \"splat/render/b.h\"\n"
  ERRORS "splat/a.h:1: \"splat/render/b.h\" is not allowed: splat may include core, autodiff, splat"
         "splat/files/c.h:1: \"splat/render/b.h\" is not allowed: splat/files may include core, autodiff, splat, splat/files")
expect("a file in no room"
  FILES pipelines/a.h "#include \"core/b.h\"\n" core/b.h ""
  ERRORS "pipelines/a.h:1: \"core/b.h\" is included in a file that is in no room")
expect("siblings"
  FILES splat/a.h "#include \"body/b.h\"\n" body/b.h "#include \"splat/a.h\"\n"
  ERRORS "splat/a.h:1: \"body/b.h\" is not allowed: splat may include core, autodiff, splat"
         "body/b.h:1: \"splat/a.h\" is not allowed: body may include core, autodiff, body")
expect("tests from the library"
  FILES autodiff/a.cpp "#include \"tests/support/b.h\"\n" tests/support/b.h ""
  ERRORS "autodiff/a.cpp:1: \"tests/support/b.h\" is not allowed: autodiff may include core, autodiff")
expect("slow libraries in headers"
  FILES core/a.h "#include <nlohmann/json.hpp>\n" pipelines/cli/b.h "#include <CLI/CLI.hpp>\n"
  ERRORS "core/a.h:1: <nlohmann/json.hpp> is slow to compile and belongs in source files only"
         "pipelines/cli/b.h:1: <CLI/CLI.hpp> is slow to compile and belongs in source files only")
expect("paths that are not from the top"
  FILES core/a.h "" core/b.cpp "#include \"a.h\"\n#include \"../core/a.h\"\n#include <core/a.h>\n"
  ERRORS "core/b.cpp:1: \"a.h\" is not a path from the top of the source tree"
         "core/b.cpp:2: \"../core/a.h\" is not a path from the top of the source tree"
         "core/b.cpp:3: <core/a.h> is a file of this project: write it in quotes")
file(REMOVE_RECURSE ${SCRATCH})

find_layering_errors(errors ${ROOT} COUNT count)
if(count LESS 50)
  message(FATAL_ERROR "Only ${count} #include lines were found under ${ROOT}: the check looks in the wrong place")
endif()
if(errors)
  list(JOIN errors "\n  " errors)
  message(FATAL_ERROR "Includes that break the rule of the layers (docs/architecture.md):\n  ${errors}")
endif()
message(STATUS "${count} includes keep the rule of the layers")
