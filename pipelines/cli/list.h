// The commands of `hsi4d`, a line each, in the order of `hsi4d --help`. HSI4D_COMMAND(name) stands for
// `void add_name(CLI::App& app, Program& program)` in pipelines/cli/name_command.cpp, which adds the command with its
// options; `run_one` is in sweep_command.cpp, `other_programs` (bench, stress) in other_programs.cpp.
#pragma once

#include "pipelines/cli/program_commands.h"

// clang-format off
#define HSI4D_COMMANDS          \
  HSI4D_COMMAND(run)            \
  HSI4D_COMMAND(demo)           \
  HSI4D_COMMAND(synth)          \
  HSI4D_COMMAND(reconstruct)    \
  HSI4D_COMMAND(align)          \
  HSI4D_COMMAND(init)           \
  HSI4D_COMMAND(locate)         \
  HSI4D_COMMAND(follow)         \
  HSI4D_COMMAND(place)          \
  HSI4D_COMMAND(joint)          \
  HSI4D_COMMAND(mesh)           \
  HSI4D_COMMAND(select_camera)  \
  HSI4D_COMMAND(evaluate)       \
  HSI4D_COMMAND(report)         \
  HSI4D_COMMAND(study)          \
  HSI4D_COMMAND(sweep)          \
  HSI4D_COMMAND(run_one)        \
  HSI4D_COMMAND(watch)          \
  HSI4D_COMMAND(render)         \
  HSI4D_COMMAND(gradients)      \
  HSI4D_COMMAND(avatar)         \
  HSI4D_COMMAND(pose)           \
  HSI4D_COMMAND(motion)         \
  HSI4D_COMMAND(convert)        \
  HSI4D_COMMAND(info)           \
  HSI4D_COMMAND(other_programs) \
  HSI4D_COMMAND(gradcheck)      \
  HSI4D_COMMAND(check)          \
  HSI4D_COMMAND(schema)         \
  HSI4D_COMMAND(list)
// clang-format on

namespace hsi4d::cli {

#define HSI4D_COMMAND(name) void add_##name(CLI::App& app, Program& program);
HSI4D_COMMANDS
#undef HSI4D_COMMAND

}  // namespace hsi4d::cli
