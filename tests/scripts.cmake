# The tests that are CMake scripts: of the source tree and of the installation rather than of functions.
add_test(NAME layering
  COMMAND ${CMAKE_COMMAND} -DROOT=${PROJECT_SOURCE_DIR} -DSCRATCH=${CMAKE_CURRENT_BINARY_DIR}/layering
                           -P ${CMAKE_CURRENT_SOURCE_DIR}/layering_test.cmake)
add_test(NAME test_names
  COMMAND ${CMAKE_COMMAND} -DROOT=${PROJECT_SOURCE_DIR} -DSCRATCH=${CMAKE_CURRENT_BINARY_DIR}/test_names
                           -P ${CMAKE_CURRENT_SOURCE_DIR}/test_names_test.cmake)
add_test(NAME gradient_audit
  COMMAND ${CMAKE_COMMAND} -DROOT=${PROJECT_SOURCE_DIR} -DSCRATCH=${CMAKE_CURRENT_BINARY_DIR}/gradient_audit
                           -P ${CMAKE_CURRENT_SOURCE_DIR}/gradient_audit_test.cmake)
set_tests_properties(layering test_names gradient_audit PROPERTIES LABELS quick TIMEOUT 300)

if(NOT HSI4D_SANITIZE)  # sanitized libraries are not installed
  if(TARGET hsi4d_python)
    set(python ${HSI4D_PYTHON3})
  endif()
  add_test(NAME install
    COMMAND ${CMAKE_COMMAND} -DROOT=${PROJECT_SOURCE_DIR} -DBUILD=${PROJECT_BINARY_DIR}
                             -DSCRATCH=${CMAKE_CURRENT_BINARY_DIR}/install -DGENERATOR=${CMAKE_GENERATOR}
                             -DCOMPILER=${CMAKE_CXX_COMPILER} -DVERSION=${PROJECT_VERSION} -DPYTHON=${python}
                             -P ${CMAKE_CURRENT_SOURCE_DIR}/install_test.cmake)
  set_tests_properties(install PROPERTIES LABELS quick TIMEOUT 300)
endif()

if(NOT HSI4D_SANITIZE)
  add_test(NAME adding_a_loss
    COMMAND ${CMAKE_COMMAND} -DROOT=${PROJECT_SOURCE_DIR} -DSCRATCH=${CMAKE_CURRENT_BINARY_DIR}/adding_a_loss
                             -DGENERATOR=${CMAKE_GENERATOR} -DCOMPILER=${CMAKE_CXX_COMPILER}
                             -P ${CMAKE_CURRENT_SOURCE_DIR}/adding_a_loss_test.cmake)
  set_tests_properties(adding_a_loss PROPERTIES LABELS full TIMEOUT 3600)
  add_test(NAME "the tutorial's scene and object from pictures"
    COMMAND ${CMAKE_COMMAND} -DROOT=${PROJECT_SOURCE_DIR} -DSCRATCH=${CMAKE_CURRENT_BINARY_DIR}/tutorial
                             -DPROGRAM=$<TARGET_FILE:hsi4d> -P ${CMAKE_CURRENT_SOURCE_DIR}/tutorial_test.cmake)
  set_tests_properties("the tutorial's scene and object from pictures" PROPERTIES LABELS full TIMEOUT 3600)
endif()

add_test(NAME "the commit of a build"
         COMMAND ${CMAKE_COMMAND} -DROOT=${PROJECT_SOURCE_DIR} -DSCRATCH=${CMAKE_CURRENT_BINARY_DIR}/commit
                                  -P ${CMAKE_CURRENT_SOURCE_DIR}/commit_test.cmake)
set_tests_properties("the commit of a build" PROPERTIES LABELS quick)

# Exporters of other programs' files, with NumPy and stand-ins for PyTorch and joblib.
find_program(HSI4D_PYTHON3 python3 HINTS /usr/bin)  # the one that Debian's NumPy belongs to
if(HSI4D_PYTHON3)
  add_test(NAME "exporters of VPoser, WHAM, GVHMR, TRAM and WHAC"
           COMMAND ${HSI4D_PYTHON3} -B ${CMAKE_CURRENT_SOURCE_DIR}/tools/exporters_test.py ${PROJECT_SOURCE_DIR}/tools
                   $<TARGET_FILE:hsi4d>)
  add_test(NAME "embeddings by CLIP"
           COMMAND ${HSI4D_PYTHON3} -B ${CMAKE_CURRENT_SOURCE_DIR}/tools/clip_embeddings_test.py ${PROJECT_SOURCE_DIR}/tools)
  add_test(NAME "keypoints of SAM 3D Body"
           COMMAND ${HSI4D_PYTHON3} -B ${CMAKE_CURRENT_SOURCE_DIR}/tools/export_keypoints_test.py ${PROJECT_SOURCE_DIR}/tools
                   $<TARGET_FILE:hsi4d>)
  set_tests_properties("keypoints of SAM 3D Body" PROPERTIES LABELS quick SKIP_RETURN_CODE 77)
  add_test(NAME "runs in MLflow's files"
           COMMAND ${HSI4D_PYTHON3} -B ${CMAKE_CURRENT_SOURCE_DIR}/tools/export_runs_test.py ${PROJECT_SOURCE_DIR}/tools)
  set_tests_properties("runs in MLflow's files" PROPERTIES LABELS quick)
  add_test(NAME "services for video, masks and poses"
           COMMAND ${HSI4D_PYTHON3} -B ${CMAKE_CURRENT_SOURCE_DIR}/tools/services_test.py ${PROJECT_SOURCE_DIR}/tools)
  add_test(NAME "masks by SAM 2"
           COMMAND ${HSI4D_PYTHON3} -B ${CMAKE_CURRENT_SOURCE_DIR}/tools/services_test.py ${PROJECT_SOURCE_DIR}/tools sam2)
  add_test(NAME "the gate of time and error"
           COMMAND ${HSI4D_PYTHON3} -B ${CMAKE_CURRENT_SOURCE_DIR}/tools/bench_test.py ${PROJECT_SOURCE_DIR}/tools)
  add_test(NAME "what the front end says of wrong input"
           COMMAND ${HSI4D_PYTHON3} -B ${CMAKE_CURRENT_SOURCE_DIR}/tools/frontend_input_test.py ${PROJECT_SOURCE_DIR}/tools)
  set_tests_properties("what the front end says of wrong input" PROPERTIES LABELS quick)
  set_tests_properties("exporters of VPoser, WHAM, GVHMR, TRAM and WHAC" "services for video, masks and poses" "embeddings by CLIP"
                       "masks by SAM 2" "the gate of time and error" PROPERTIES LABELS quick SKIP_RETURN_CODE 77)
  add_test(NAME "measures of meshes, and meshes with truth"
           COMMAND ${HSI4D_PYTHON3} -B ${CMAKE_CURRENT_SOURCE_DIR}/tools/mesh_measures_test.py ${PROJECT_SOURCE_DIR}/tools)
  set_tests_properties("measures of meshes, and meshes with truth" PROPERTIES LABELS quick SKIP_RETURN_CODE 77)
  add_test(NAME "links between pages"
           COMMAND ${HSI4D_PYTHON3} -B ${CMAKE_CURRENT_SOURCE_DIR}/tools/links_test.py ${PROJECT_SOURCE_DIR})
  set_tests_properties("links between pages" PROPERTIES LABELS quick)
  add_test(NAME "events for TensorBoard"
           COMMAND ${HSI4D_PYTHON3} -B ${CMAKE_CURRENT_SOURCE_DIR}/tools/tensorboard_test.py $<TARGET_FILE:hsi4d>)
  set_tests_properties("events for TensorBoard" PROPERTIES LABELS quick TIMEOUT 300)
else()
  message(STATUS "There is no python3: the exporters, services and events are not tested")
endif()

# Sweeps on a cluster of Slurm on this machine: it says so where Slurm is missing (tools/slurm-local install installs it).
if(HSI4D_PYTHON3 AND NOT HSI4D_SANITIZE)
  add_test(NAME "sweeps by Slurm"
           COMMAND ${HSI4D_PYTHON3} -B ${CMAKE_CURRENT_SOURCE_DIR}/tools/slurm_sweep_test.py ${PROJECT_SOURCE_DIR}/tools
                   $<TARGET_FILE:hsi4d> ${PROJECT_SOURCE_DIR}/configs)
  set_tests_properties("sweeps by Slurm" PROPERTIES LABELS full SKIP_RETURN_CODE 77 TIMEOUT 1500)
endif()

# The person in a video by BlazePose: it says so where its packages or Chromium are missing.
if(HSI4D_PYTHON3 AND NOT HSI4D_SANITIZE)
  add_test(NAME "the front end finds a person"
           COMMAND ${HSI4D_PYTHON3} -B ${CMAKE_CURRENT_SOURCE_DIR}/tools/frontend_test.py ${PROJECT_SOURCE_DIR}/tools
                   $<TARGET_FILE:hsi4d> ${PROJECT_SOURCE_DIR}/build/frontend)
  set_tests_properties("the front end finds a person" PROPERTIES LABELS full SKIP_RETURN_CODE 77 TIMEOUT 900)
endif()

# The report, a study and a run that is watched in a browser; they say so where playwright-core or Chromium is missing (tools/test_report installs them).
find_program(HSI4D_NODE node)
if(HSI4D_SANITIZE)  # the pages are the same, and the program takes longer to make one
elseif(HSI4D_NODE)
  add_test(NAME "the report in a browser"
           COMMAND ${HSI4D_NODE} ${CMAKE_CURRENT_SOURCE_DIR}/pipelines/report/browser_test.mjs $<TARGET_FILE:hsi4d>
                   ${PROJECT_SOURCE_DIR}/build/report_browser/node_modules)
  add_test(NAME "a study in a browser"
           COMMAND ${HSI4D_NODE} ${CMAKE_CURRENT_SOURCE_DIR}/pipelines/study/browser_test.mjs $<TARGET_FILE:hsi4d>
                   ${PROJECT_SOURCE_DIR}/build/report_browser/node_modules)
  add_test(NAME "watching a run in a browser"
           COMMAND ${HSI4D_NODE} ${CMAKE_CURRENT_SOURCE_DIR}/pipelines/watch/browser_test.mjs $<TARGET_FILE:hsi4d>
                   ${PROJECT_SOURCE_DIR}/build/report_browser/node_modules)
  set_tests_properties("the report in a browser" "a study in a browser" "watching a run in a browser"
                       PROPERTIES LABELS quick SKIP_RETURN_CODE 77 TIMEOUT 600)
else()
  message(STATUS "There is no node: the report, a study and `hsi4d watch` are not tested in a browser")
endif()

# The Python module, and its page, docs/python.md.
if(TARGET hsi4d_python)
  add_test(NAME python COMMAND ${HSI4D_PYTHON3} -B -m unittest discover -s ${CMAKE_CURRENT_SOURCE_DIR}/python -p "*_test.py")
  set_tests_properties(python PROPERTIES LABELS quick TIMEOUT 600
    ENVIRONMENT "PYTHONPATH=${PROJECT_BINARY_DIR}/python;HSI4D_PROGRAM=$<TARGET_FILE:hsi4d>")
endif()
