# cmake -DROOT=source tree -DSCRATCH=folder -P test_names_test.cmake
# Fails when ctest could not find or run a test case of the source tree by its name; before that, proves on made-up trees
# that each kind of bad name is found, and that no other is.
cmake_minimum_required(VERSION 3.25)
include(${CMAKE_CURRENT_LIST_DIR}/test_names.cmake)

# Characters that CMake's lists cannot carry, for the made-up files.
set(open "[")
set(close "]")
set(semicolon ";")
set(backslash "\\")

# expect(TITLE FILES… ERRORS…): a tree of FILES (path, text, path, text, …) has exactly these ERRORS.
function(expect title)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "" "FILES;ERRORS")
  file(REMOVE_RECURSE ${SCRATCH})
  while(arg_FILES)
    list(POP_FRONT arg_FILES path text)
    string(CONFIGURE "${text}" text @ONLY)
    file(WRITE ${SCRATCH}/${path} "${text}")
  endwhile()
  find_name_errors(found ${SCRATCH})
  if(NOT "${found}" STREQUAL "${arg_ERRORS}")
    list(JOIN found "\n  " found)
    list(JOIN arg_ERRORS "\n  " wanted)
    message(FATAL_ERROR "The check of test names itself is wrong (${title}).\nExpected:\n  ${wanted}\nFound:\n  ${found}")
  endif()
endfunction()

expect("good names"
  FILES tests/core/a_test.cpp "// \nTEST_CASE(\"a, (b) @open@B1, B2@close@: 'c' * 2 ~ 3 #4 - é?\", \"@open@full@close@\") {\n  int x@open@2@close@@semicolon@\n}\n"
        tests/core/b_test.cpp "TEMPLATE_TEST_CASE(\n    \"over two lines\", \"\", float, double) {}\nint TEST_CASE_COUNT@semicolon@\n"
        tests/splat/b_test.cpp "TEST_CASE(\"over two lines\") {}\n#define X TEST_CASE(\n")
expect("a semicolon"
  FILES tests/core/a_test.cpp "\n\nTEST_CASE(\"one\") {}\nTEST_CASE(\"two@semicolon@ three\") {}\n"
  ERRORS "tests/core/a_test.cpp:4: two, three holds a semicolon: ctest would make two tests of it")
expect("brackets"
  FILES tests/core/a_test.cpp "TEST_CASE(\"in @open@0, 1)\") {}\nTEST_CASE(\"in (0, 1@close@\") {}\nTEST_CASE(\"@open@@open@a@close@=@close@\") {}\n"
  ERRORS "tests/core/a_test.cpp:1: in {0, 1) has brackets that do not pair: ctest would join it to the next name"
         "tests/core/a_test.cpp:2: in (0, 1} has brackets that do not pair: ctest would join it to the next name"
         "tests/core/a_test.cpp:3: {{a}=} holds what ends a text in CMake: square brackets one after the other")
expect("backslashes"
  FILES tests/core/a_test.cpp "TEST_CASE(\"a@backslash@@backslash@b\") {}\nTEST_CASE(\"a @backslash@\"b@backslash@\" c\") {}\n"
  ERRORS "tests/core/a_test.cpp:1: a//b holds a backslash: Catch would take it for an escape"
         "tests/core/a_test.cpp:2: a name with a backslash: Catch would take it for an escape")
expect("patterns and options"
  FILES tests/core/a_test.cpp "TEST_CASE(\"-a\") {}\nTEST_CASE(\"~a\") {}\nTEST_CASE(\"*a\") {}\nTEST_CASE(\"a*\") {}\nTEST_CASE(\"exclude:a\") {}\nTEST_CASE(\"\") {}\n"
  ERRORS "tests/core/a_test.cpp:1: -a starts with what means something on Catch's command line"
         "tests/core/a_test.cpp:2: ~a starts with what means something on Catch's command line"
         "tests/core/a_test.cpp:3: *a starts or ends with an asterisk: Catch would run other tests too"
         "tests/core/a_test.cpp:4: a* starts or ends with an asterisk: Catch would run other tests too"
         "tests/core/a_test.cpp:5: exclude:a starts with what means something on Catch's command line"
         "tests/core/a_test.cpp:6: is empty")
expect("names that Catch cannot tell apart"
  FILES tests/core/a_test.cpp "TEST_CASE(\"One\") {}\n" tests/core/b_test.cpp "TEST_CASE(\"one\") {}\n"
  ERRORS "tests/core/b_test.cpp:1: one is also the name of another test of this folder, but for upper and lower case at most")
expect("names that are not one literal"
  FILES tests/core/a_test.cpp "TEST_CASE(\"one\" \"two\") {}\nTEST_CASE(kName) {}\n"
  ERRORS "tests/core/a_test.cpp:1: a name that is not one literal, which this check cannot read"
         "tests/core/a_test.cpp:2: a name that is not one literal, which this check cannot read")
file(REMOVE_RECURSE ${SCRATCH})

find_name_errors(errors ${ROOT} COUNT count)
if(count LESS 500)
  message(FATAL_ERROR "Only ${count} test cases were found under ${ROOT}/tests: the check looks in the wrong place")
endif()
if(errors)
  list(JOIN errors "\n  " errors)
  message(FATAL_ERROR "Names of test cases that ctest cannot find or run (tests/test_names.cmake):\n  ${errors}")
endif()
message(STATUS "${count} test cases have names that ctest can find and run")
