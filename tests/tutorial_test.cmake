# cmake -DROOT=source tree -DSCRATCH=folder -DPROGRAM=hsi4d -P tutorial_test.cmake
# Does what step 5 of docs/tutorial.md says, to the letter: every command that it has, in its order, and the config
# that it tells to write. Then looks whether the run found person and object.
cmake_minimum_required(VERSION 3.25)

set(page docs/tutorial.md)
set(title "## 5. A scene and an object from pictures")

# rest_of(OUT TEXT PART): TEXT behind PART; stops where the page no longer has it.
function(rest_of out text part)
  string(FIND "${text}" "${part}" at)
  if(at EQUAL -1)
    message(FATAL_ERROR "${page} no longer says '${part}'")
  endif()
  string(LENGTH "${part}" length)
  math(EXPR at "${at} + ${length}")
  string(SUBSTRING "${text}" ${at} -1 rest)
  set(${out} "${rest}" PARENT_SCOPE)
endfunction()

# until(OUT TEXT PART): TEXT before PART.
function(until out text part)
  string(FIND "${text}" "${part}" at)
  string(SUBSTRING "${text}" 0 ${at} before)
  set(${out} "${before}" PARENT_SCOPE)
endfunction()

file(REMOVE_RECURSE ${SCRATCH})
file(COPY ${ROOT}/configs DESTINATION ${SCRATCH})
file(READ ${ROOT}/${page} text)
rest_of(text "${text}" "${title}\n")
until(text "${text}" "\n## ")
rest_of(config "${text}" "Write this as `runs/made.json`")
rest_of(config "${config}" "```json\n")
until(config "${config}" "```")
file(WRITE ${SCRATCH}/runs/made.json "${config}")

string(REGEX REPLACE " *\\\\\n +" " " text "${text}")  # commands of several lines
string(REGEX MATCHALL "\n    hsi4d [^\n]+" commands "${text}")
foreach(command IN LISTS commands)
  string(STRIP "${command}" command)
  separate_arguments(words UNIX_COMMAND "${command}")
  list(REMOVE_AT words 0)
  execute_process(COMMAND ${PROGRAM} ${words} WORKING_DIRECTORY ${SCRATCH}
                  RESULT_VARIABLE result OUTPUT_VARIABLE output ERROR_VARIABLE output)
  if(result)
    message(FATAL_ERROR "${command} failed (${result}):\n${output}")
  endif()
  message(STATUS "${command}: done")
endforeach()
message("${output}")

# Errors of the run with what was made.
execute_process(COMMAND ${PROGRAM} evaluate runs/made --json runs/errors.json WORKING_DIRECTORY ${SCRATCH}
                RESULT_VARIABLE result OUTPUT_VARIABLE output ERROR_VARIABLE output)
if(result)
  message(FATAL_ERROR "hsi4d evaluate runs/made --json failed (${result}):\n${output}")
endif()
file(READ ${SCRATCH}/runs/errors.json json)
foreach(bound "world_mpjpe_mm 40" "object_translation_cm 5")
  separate_arguments(bound)
  list(GET bound 0 metric)
  list(GET bound 1 most)
  string(JSON value GET "${json}" results 0 ${metric})
  if(NOT value LESS most)
    message(FATAL_ERROR "${metric} is ${value} and not below ${most}:\n${output}")
  endif()
endforeach()
file(REMOVE_RECURSE ${SCRATCH})
