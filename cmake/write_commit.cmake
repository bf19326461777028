# cmake -DGIT=program -DSOURCE=folder -DCOMMIT=twelve digits -DHEADER=file -P write_commit.cmake
# Writes the commit of a build into a header, "-modified" behind it where the sources of the program differ from it. The
# header stays as it is while that does not change, so that nothing is compiled anew.
cmake_minimum_required(VERSION 3.25)

set(HSI4D_COMMIT ${COMMIT})
if(GIT AND NOT COMMIT STREQUAL unknown)
  execute_process(COMMAND ${GIT} --no-optional-locks status --porcelain -- core autodiff splat body optim stress pipelines cmake
                          CMakeLists.txt configs/best.json configs/demo.json configs/demo_quick.json
                  WORKING_DIRECTORY ${SOURCE} RESULT_VARIABLE status OUTPUT_VARIABLE changes ERROR_QUIET)
  if(status EQUAL 0 AND NOT changes STREQUAL "")
    string(APPEND HSI4D_COMMIT -modified)
  endif()
endif()
file(CONFIGURE OUTPUT ${HEADER} CONTENT "#define HSI4D_GIT_COMMIT \"@HSI4D_COMMIT@\"\n" @ONLY)
