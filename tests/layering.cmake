# The rule of the layers and of the rooms in them, read from the #include lines. A room may include what it stands on, and
# what that stands on; CMakeLists.txt has the same table for the linker.

# ROOM: what it stands on. A file belongs to the innermost room whose folder it is in.
set(stands_on
    "core:" "autodiff: core"
    "splat: autodiff" "splat/files: splat" "splat/render: splat" "splat/reference: splat/render"
    "body: autodiff"
    "optim: splat/files splat/reference body" "optim/solid: splat/files splat/reference body"
    "optim/losses: optim optim/solid"
    "pipelines/config: optim/losses" "pipelines/input: pipelines/config" "pipelines/draw: pipelines/input"
    "pipelines/metrics: pipelines/input" "pipelines/record: pipelines/metrics" "pipelines/graph: pipelines/draw"
    "pipelines/follow: pipelines/input" "pipelines/sources: pipelines/draw pipelines/follow" "pipelines/avatar: pipelines/draw" "pipelines/footage: pipelines/draw"
    "pipelines/photos: core" "pipelines/synthetic: pipelines/draw pipelines/photos"
    "pipelines/report: pipelines/draw pipelines/record" "pipelines/evaluate: pipelines/record"
    "pipelines/rig: pipelines/photos optim/solid"
    "pipelines/scan: pipelines/rig pipelines/report"
    "pipelines/run: pipelines/graph pipelines/sources pipelines/report" "pipelines/chain: pipelines/run"
    "pipelines/sweep: pipelines/chain pipelines/synthetic" "pipelines/study: pipelines/sweep pipelines/evaluate"
    "pipelines/locate: pipelines/graph pipelines/scan"
    "pipelines/cli: pipelines/study pipelines/avatar pipelines/footage pipelines/locate"
    "python: pipelines/sweep"
    "bench: pipelines/cli" "stress: pipelines/cli")

set(rooms "")
set(layers "")
foreach(row ${stands_on})
  string(REGEX MATCH "^([^:]+):(.*)$" row "${row}")
  set(room ${CMAKE_MATCH_1})
  string(REGEX MATCHALL "[^ ]+" below "${CMAKE_MATCH_2}")
  set(may_include_${room} "")
  foreach(lower ${below})
    list(APPEND may_include_${room} ${may_include_${lower}})
  endforeach()
  list(APPEND may_include_${room} ${room})
  list(REMOVE_DUPLICATES may_include_${room})
  list(APPEND rooms ${room})
  string(REGEX MATCH "^[^/]+" layer ${room})
  list(APPEND layers ${layer})
endforeach()
list(REMOVE_DUPLICATES layers)

# room_of(OUT path): the room of a file, or nothing.
function(room_of out path)
  cmake_path(GET path PARENT_PATH folder)
  while(folder AND NOT folder IN_LIST rooms)
    cmake_path(GET folder PARENT_PATH folder)
  endwhile()
  set(${out} "${folder}" PARENT_SCOPE)
endfunction()

# Libraries that take seconds to compile: in source files only.
set(not_in_headers "^(nlohmann|CLI)/")

# explain_include(OUT root file written): why `#include written` ("…" or <…>) is not allowed in root/file, or nothing.
function(explain_include out root file written)
  room_of(room ${file})
  string(REGEX REPLACE "[<>\"]" "" path ${written})
  string(REGEX MATCH "^[^/]+" layer ${path})
  room_of(target ${path})
  set(reason "")
  if(file MATCHES "\\.h$" AND path MATCHES ${not_in_headers})
    set(reason "is slow to compile and belongs in source files only")
  elseif(written MATCHES "^<")
    if(path MATCHES "/" AND layer IN_LIST layers AND EXISTS ${root}/${path})
      set(reason "is a file of this project: write it in quotes")
    endif()
  elseif(NOT EXISTS ${root}/${path} OR NOT path MATCHES "/" OR path MATCHES "(^|/)\\.\\.?/")
    set(reason "is not a path from the top of the source tree")
  elseif(NOT room)
    set(reason "is included in a file that is in no room")
  elseif(NOT target OR NOT target IN_LIST may_include_${room})
    string(REPLACE ";" ", " allowed "${may_include_${room}}")
    set(reason "is not allowed: ${room} may include ${allowed}")
  endif()
  set(${out} "${reason}" PARENT_SCOPE)
endfunction()

# line_of(OUT text part): the line on which the first `part` of `text` ends.
function(line_of out text part)
  string(FIND "${text}" "${part}" at)
  string(SUBSTRING "${text}" 0 ${at} before)
  string(LENGTH "${before}" all)
  string(REPLACE "\n" "" before "${before}")
  string(LENGTH "${before}" kept)
  string(REGEX MATCHALL "^\n" own "${part}")
  list(LENGTH own own)
  math(EXPR line "${all} - ${kept} + 1 + ${own}")
  set(${out} ${line} PARENT_SCOPE)
endfunction()

# find_layering_errors(OUT root [COUNT variable]): one "file:line: #include … reason" for each line that breaks the rule.
function(find_layering_errors out root)
  cmake_parse_arguments(PARSE_ARGV 2 arg "" "COUNT" "")
  set(errors "")
  set(count 0)
  foreach(layer ${layers})
    file(GLOB_RECURSE files RELATIVE ${root} ${root}/${layer}/*.h ${root}/${layer}/*.cpp)
    list(SORT files)
    foreach(file ${files})
      file(READ ${root}/${file} text)
      # A list separator or bracket in the text would be taken for CMake's own.
      string(REGEX REPLACE "[][;\\]" "_" text "\n${text}")
      string(REGEX MATCHALL "\n[ \t]*#[ \t]*include[ \t]*(\"[^\"\n]*\"|<[^>\n]*>)" includes "${text}")
      foreach(include ${includes})
        math(EXPR count "${count} + 1")
        string(REGEX MATCH "(\"[^\"\n]*\"|<[^>\n]*>)$" written "${include}")
        explain_include(reason ${root} ${file} ${written})
        if(reason)
          line_of(line "${text}" "${include}")
          math(EXPR line "${line} - 1")  # for the line break put in front
          list(APPEND errors "${file}:${line}: ${written} ${reason}")
        endif()
      endforeach()
    endforeach()
  endforeach()
  set(${out} "${errors}" PARENT_SCOPE)
  if(arg_COUNT)
    set(${arg_COUNT} ${count} PARENT_SCOPE)
  endif()
endfunction()
