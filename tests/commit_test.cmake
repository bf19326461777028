# cmake -DROOT=source tree -DSCRATCH=folder -P commit_test.cmake
# What cmake/write_commit.cmake says of a checkout as it was committed, with changes, and of no checkout.
cmake_minimum_required(VERSION 3.25)

find_program(GIT git)
set(header ${SCRATCH}/commit.h)
set(source ${SCRATCH}/source)

# expect(WHAT GIT COMMIT WANTED): the header that is written.
function(expect what git commit wanted)
  execute_process(COMMAND ${CMAKE_COMMAND} -DGIT=${git} -DSOURCE=${source} -DCOMMIT=${commit} -DHEADER=${header}
                          -P ${ROOT}/cmake/write_commit.cmake RESULT_VARIABLE status)
  file(READ ${header} text)
  if(status OR NOT text STREQUAL "#define HSI4D_GIT_COMMIT \"${wanted}\"\n")
    message(FATAL_ERROR "${what}: status ${status}, the header is\n${text}")
  endif()
endfunction()

function(git)
  execute_process(COMMAND ${GIT} -c user.name=test -c user.email=test@localhost ${ARGN} WORKING_DIRECTORY ${source}
                  RESULT_VARIABLE status OUTPUT_VARIABLE output ERROR_VARIABLE output)
  if(status)
    message(FATAL_ERROR "git ${ARGN} failed:\n${output}")
  endif()
endfunction()

file(REMOVE_RECURSE ${SCRATCH})
file(WRITE ${source}/core/a.cpp "a\n")
file(WRITE ${source}/docs/a.md "a\n")
expect("no git" "" unknown unknown)
if(NOT GIT)
  return()
endif()
git(init -q)
git(add .)
git(commit -q -m first)
expect("as committed" ${GIT} 0123456789ab 0123456789ab)
file(APPEND ${source}/docs/a.md "b\n")
file(WRITE ${source}/mine.json "{}\n")
expect("other files are no sources" ${GIT} 0123456789ab 0123456789ab)
expect("a commit that is not known" ${GIT} unknown unknown)
file(WRITE ${source}/core/b.cpp "b\n")
expect("a new source" ${GIT} 0123456789ab 0123456789ab-modified)
file(REMOVE ${source}/core/b.cpp)
expect("back again" ${GIT} 0123456789ab 0123456789ab)
file(APPEND ${source}/core/a.cpp "b\n")
expect("a changed source" ${GIT} 0123456789ab 0123456789ab-modified)
