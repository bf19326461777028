# cmake -DROOT=source tree -DSCRATCH=folder -DGENERATOR=… -DCOMPILER=… -P adding_a_loss_test.cmake
# Does to a copy of the source tree what docs/adding_a_loss.md says, to the letter: one new file, one line of the list,
# one config. Builds the program and the tests of the terms, runs these and a short run with the new term, then what else
# a new term meets: the other tests of its layer, the tools that write its rows of pages, and the tests of these pages.
#
# Only git's files are copied, with what was changed in them; the build folder lies in the copy as build/release does in
# a source tree, so that a compiler cache that knows relative paths (CCACHE_BASEDIR) has most objects already.
cmake_minimum_required(VERSION 3.25)

set(source ${SCRATCH}/source)
set(build ${source}/build/release)

# run(TITLE COMMAND…): in the copy; stops with the output when it fails, else leaves the output in `output`.
function(run title)
  execute_process(COMMAND ${ARGN} WORKING_DIRECTORY ${source}
                  RESULT_VARIABLE result OUTPUT_VARIABLE output ERROR_VARIABLE output)
  if(result)
    message(FATAL_ERROR "${title} failed (${result}):\n${output}")
  endif()
  message(STATUS "${title}: done")
  set(output "${output}" PARENT_SCOPE)
endfunction()

# expect(WHAT TEXT PART): stops when TEXT does not hold PART.
function(expect what text part)
  string(FIND "${text}" "${part}" at)
  if(at EQUAL -1)
    message(FATAL_ERROR "${what} does not hold '${part}':\n${text}")
  endif()
endfunction()

# matched(OUT TEXT REGEX WHAT): the first group of the match.
function(matched out text regex what)
  if(NOT text MATCHES "${regex}")
    message(FATAL_ERROR "docs/adding_a_loss.md no longer says ${what}")
  endif()
  set(${out} "${CMAKE_MATCH_1}" PARENT_SCOPE)
endfunction()

# code_block(OUT TEXT LANGUAGE AFTER): the first block of a language behind the text AFTER.
function(code_block out text language after)
  string(FIND "${text}" "${after}" begin)
  if(begin EQUAL -1)
    message(FATAL_ERROR "docs/adding_a_loss.md no longer says '${after}'")
  endif()
  string(SUBSTRING "${text}" ${begin} -1 text)
  string(FIND "${text}" "```${language}\n" begin)
  string(LENGTH "```${language}\n" fence)
  math(EXPR begin "${begin} + ${fence}")
  string(SUBSTRING "${text}" ${begin} -1 text)
  string(FIND "${text}" "```\n" length)
  string(SUBSTRING "${text}" 0 ${length} text)
  set(${out} "${text}" PARENT_SCOPE)
endfunction()

function(copy_sources)
  execute_process(COMMAND git -C ${ROOT} ls-files RESULT_VARIABLE result OUTPUT_VARIABLE files ERROR_QUIET)
  if(result)  # no git, or an archive of the sources
    file(COPY ${ROOT}/ DESTINATION ${source} PATTERN build EXCLUDE PATTERN runs EXCLUDE PATTERN ".?*" EXCLUDE)
    return()
  endif()
  string(STRIP "${files}" files)
  string(REPLACE "\n" ";" files "${files}")
  foreach(file IN LISTS files)
    if(NOT EXISTS ${ROOT}/${file})  # removed, and that not yet committed
      continue()
    endif()
    cmake_path(GET file PARENT_PATH folder)
    file(MAKE_DIRECTORY ${source}/${folder})
    file(COPY_FILE ${ROOT}/${file} ${source}/${file})
  endforeach()
endfunction()

file(REMOVE_RECURSE ${SCRATCH})
copy_sources()

# One new file, one line of the list (the one before it gets its backslash), one config.
file(READ ${source}/docs/adding_a_loss.md doc)
matched(name "${doc}" "Make `optim/losses/([a-z_]+)\\.cpp`:" "which file to make")
matched(list_line "${doc}" "Add `(HSI4D_LOSS\\([a-z_]+\\))` to `optim/losses/list\\.h`" "which line to add")
code_block(code "${doc}" cpp "Make `optim/losses/${name}.cpp`:")
code_block(config "${doc}" json "Use it in a stage of a config")
file(WRITE ${source}/optim/losses/${name}.cpp "${code}")
file(READ ${source}/optim/losses/list.h list)
string(REGEX REPLACE "(HSI4D_LOSS\\([a-z_0-9]+\\))\n// clang-format on" "\\1 \\\\\n  ${list_line}\n// clang-format on"
       list_after "${list}")
if(list_after STREQUAL list)
  message(FATAL_ERROR "optim/losses/list.h: the end of the list is not found")
endif()
file(WRITE ${source}/optim/losses/list.h "${list_after}")
file(WRITE ${source}/mine.json "${config}")

run("Configuring" ${CMAKE_COMMAND} -S ${source} -B ${build} -G ${GENERATOR} -DCMAKE_CXX_COMPILER=${COMPILER}
    -DCMAKE_BUILD_TYPE=Release -DHSI4D_WARNINGS_AS_ERRORS=ON)
run("Building the program with the new term" ${CMAKE_COMMAND} --build ${build} --parallel 2 --target hsi4d)
set(program ${build}/bin/hsi4d)
run("hsi4d list losses" ${program} list losses)
expect("What hsi4d list losses prints" "${output}" "${name}")
run("hsi4d schema" ${program} schema)
expect("The schema" "${output}" "\"${name}\"")
# The commands of the text, made short.
set(short --set synthetic.frames=3 --set synthetic.size_px=48 --set synthetic.scene_gaussians=1500
          --set synthetic.avatar_gaussians=500 --set synthetic.object_gaussians=150)
expect("docs/adding_a_loss.md" "${doc}" "hsi4d synth configs/demo_quick.json --out runs/loss-clip")
run("hsi4d synth" ${program} synth configs/demo_quick.json --out runs/loss-clip ${short})
run("hsi4d check" ${program} check mine.json)
expect("docs/adding_a_loss.md" "${doc}" "hsi4d run mine.json --out runs/${name}")
run("hsi4d run" ${program} run mine.json --out runs/${name} --threads 1 --set stages.interaction.iterations=5)
file(STRINGS ${source}/runs/${name}/metrics.jsonl lines REGEX "\"stage\": \"interaction\"")
list(LENGTH lines count)
if(NOT count EQUAL 10)
  message(FATAL_ERROR "The run has ${count} iterations of its stage and not 10")
endif()
foreach(line IN LISTS lines)
  if(NOT line MATCHES "\"losses\": {[^}]*\"${name}\": [0-9]")
    message(FATAL_ERROR "A line of metrics.jsonl is without the new term: ${line}")
  endif()
endforeach()

run("Building the tests of the terms" ${CMAKE_COMMAND} --build ${build} --parallel 2 --target hsi4d_test_optim)
run("The tests of the terms" ${build}/bin/hsi4d_test_optim "*loss term*")
expect("What the tests print" "${output}" "All tests passed")
run("All tests of their layer" ${build}/bin/hsi4d_test_optim "~[full]")
# The pages that tests compare with the program: both tests fail before their tools have run.
expect("docs/adding_a_loss.md" "${doc}" "tools/settings_page && tools/gradient_audit --losses")
run("tools/settings_page" ${source}/tools/settings_page)
run("tools/gradient_audit --losses" ${source}/tools/gradient_audit --losses)
expect("What the audit prints" "${output}" "all within their bounds")
run("The test of the audit" ${CMAKE_COMMAND} -DROOT=${source} -DSCRATCH=${SCRATCH}/audit
    -P ${source}/tests/gradient_audit_test.cmake)
run("Building the test of the page of settings" ${CMAKE_COMMAND} --build ${build} --parallel 2
    --target hsi4d_test_pipelines_cli)
run("The test of the page of settings" ${build}/bin/hsi4d_test_pipelines_cli
    "the page of settings tells every setting as it is,every setting whose default does not show*")
expect("What the test of the page prints" "${output}" "All tests passed")
file(REMOVE_RECURSE ${SCRATCH})
