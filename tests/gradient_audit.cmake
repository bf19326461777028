# The audit of gradients, docs/numerics/gradients.md, has a row for every operator and every loss term, and no other.

# names_in(OUT pattern files…): the first group of every match of pattern, sorted, each once.
function(names_in out pattern)
  set(names "")
  foreach(file ${ARGN})
    file(READ ${file} text)
    # A list separator or bracket in the text would be taken for CMake's own.
    string(REGEX REPLACE "[][;\\]" "_" text "${text}")
    string(REGEX MATCHALL "${pattern}" found "${text}")
    foreach(match IN LISTS found)
      string(REGEX REPLACE "${pattern}" "\\1" name "${match}")
      list(APPEND names "${name}")
    endforeach()
  endforeach()
  list(REMOVE_DUPLICATES names)
  list(SORT names)
  set(${out} "${names}" PARENT_SCOPE)
endfunction()

# find_audit_errors(OUT root): one line for each operator or loss term without a row or its figures, and for each row without
# one of them.
function(find_audit_errors out root)
  set(sources "")
  foreach(layer core autodiff splat body optim)
    file(GLOB_RECURSE files ${root}/${layer}/*.h ${root}/${layer}/*.cpp)
    list(APPEND sources ${files})
  endforeach()
  names_in(operators "kName = \"([^\"]+)\"" ${sources})
  names_in(losses "\n  HSI4D_LOSS\\(([a-z0-9_]+)\\)" ${root}/optim/losses/list.h)
  names_in(rows "\n\\| `([a-z0-9_]+)` " ${root}/docs/numerics/gradients.md)
  # Inputs, then float, differences, complex step.
  set(figure "\\| [0-9][^|\n]* ")
  names_in(measured "\n\\| `([a-z0-9_]+)` \\| [^|\n]+ ${figure}${figure}${figure}" ${root}/docs/numerics/gradients.md)
  set(errors "")
  foreach(name ${operators} ${losses})
    if(NOT name IN_LIST rows)
      list(APPEND errors "${name} has no row")
    elseif(NOT name IN_LIST measured AND NOT name STREQUAL "stop_gradient")  # which has no adjoint
      list(APPEND errors "${name} lacks a figure")
    endif()
  endforeach()
  foreach(name ${rows})
    if(NOT name IN_LIST operators AND NOT name IN_LIST losses)
      list(APPEND errors "there is no ${name}")
    endif()
  endforeach()
  set(${out} "${errors}" PARENT_SCOPE)
endfunction()
