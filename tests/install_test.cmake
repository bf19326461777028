# cmake -DBUILD=build folder -DSCRATCH=folder -DGENERATOR=… -DCOMPILER=… -DVERSION=… -DROOT=source tree -DPYTHON=…
#       -P install_test.cmake
# Installs the build into a fresh prefix, moves that prefix, and builds and runs the outside project of tests/install
# against it.
cmake_minimum_required(VERSION 3.25)

# run(TITLE COMMAND…): stops with the output when it fails; else leaves the output in `output`.
function(run title)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE result OUTPUT_VARIABLE output ERROR_VARIABLE output)
  if(result)
    message(FATAL_ERROR "${title} failed (${result}):\n${output}")
  endif()
  set(output "${output}" PARENT_SCOPE)
endfunction()

# check_equal(WHAT FOUND WANTED)
function(check_equal what found wanted)
  if(NOT found STREQUAL wanted)
    message(FATAL_ERROR "${what} is \"${found}\" and not \"${wanted}\"")
  endif()
endfunction()

file(REMOVE_RECURSE ${SCRATCH})
run("The installation" ${CMAKE_COMMAND} --install ${BUILD} --prefix ${SCRATCH}/first)
file(RENAME ${SCRATCH}/first ${SCRATCH}/prefix)

# Nothing in the package points back to the trees that it was made from.
file(GLOB_RECURSE package_files ${SCRATCH}/prefix/*.cmake)
if(NOT package_files)
  message(FATAL_ERROR "No CMake package was installed under ${SCRATCH}/prefix")
endif()
foreach(file ${package_files})
  file(READ ${file} text)
  string(REPLACE "${SCRATCH}" "" text "${text}")
  foreach(folder ${BUILD} ${ROOT})
    string(FIND "${text}" "${folder}/" at)
    if(NOT at EQUAL -1)
      message(FATAL_ERROR "${file} names a folder of the build machine: ${folder}")
    endif()
  endforeach()
endforeach()

run("Configuring the outside project"
  ${CMAKE_COMMAND} -S ${CMAKE_CURRENT_LIST_DIR}/install -B ${SCRATCH}/outside -G ${GENERATOR}
                   -DCMAKE_CXX_COMPILER=${COMPILER} -DCMAKE_BUILD_TYPE=Release
                   -DCMAKE_PREFIX_PATH=${SCRATCH}/prefix -DCMAKE_FIND_USE_PACKAGE_REGISTRY=OFF)
run("Building the outside project" ${CMAKE_COMMAND} --build ${SCRATCH}/outside)
run("The outside program" ${SCRATCH}/outside/outside)
foreach(expected "hsi4d ${VERSION}\n" "gradient check of saturation: " "photometric" "Difference of the colours' saturation")
  string(FIND "${output}" "${expected}" at)
  if(at EQUAL -1)
    message(FATAL_ERROR "The outside program does not print '${expected}':\n${output}")
  endif()
endforeach()
run("The installed program" ${SCRATCH}/prefix/bin/hsi4d --version)
if(NOT output MATCHES "^hsi4d ${VERSION} \\(([0-9a-f]+(-modified)?|unknown)\\)\n$")
  message(FATAL_ERROR "The installed program prints \"${output}\" and not its version and commit")
endif()
# The module, with an image that a library of its own reads; without PYTHON it was not built.
if(PYTHON)
  file(GLOB_RECURSE stubs ${SCRATCH}/prefix/hsi4d.pyi)
  cmake_path(GET stubs PARENT_PATH folder)
  file(WRITE ${SCRATCH}/image.ppm "P3\n1 1\n255\n255 0 51\n")
  file(WRITE ${SCRATCH}/image.py "import hsi4d\nimage = 255 * hsi4d.read_image('${SCRATCH}/image.ppm')\n"
                                 "print(hsi4d.__version__, image.round().tolist())\n")
  run("The installed Python module" ${CMAKE_COMMAND} -E env PYTHONPATH=${folder} ${PYTHON} -B ${SCRATCH}/image.py)
  check_equal("What the installed Python module prints" "${output}" "${VERSION} [[[255.0, 0.0, 51.0]]]\n")
endif()
file(REMOVE_RECURSE ${SCRATCH})
