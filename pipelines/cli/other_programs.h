// Commands that are programs of their own: they measure and stress the library, which few users do.
#pragma once

#include <array>

namespace hsi4d::cli {

/// `hsi4d COMMAND` starts the program `hsi4d-COMMAND` beside `hsi4d`.
struct OtherProgram {
  const char* command;
  const char* summary;
};

inline constexpr OtherProgram kBenchProgram = {
    "bench",
    "Measure the speed of the renderer, the body, the tape or a whole run, time against error, or the pixel filter: "
    "a table, and one JSON object a measurement"};
inline constexpr OtherProgram kStressProgram = {
    "stress",
    "Try every known way to fail: a row each, with what was measured, what is allowed, and what it would be without "
    "the remedy"};
inline constexpr std::array<OtherProgram, 2> kOtherPrograms = {kBenchProgram, kStressProgram};

/// True where the command line names one of them.
bool is_other_program(int argc, const char* const* argv);

/// Goes on as that program, with the arguments behind its name. Does not return.
/// Throws UserError telling how to build it where it is not beside this program.
[[noreturn]] void become_other_program(const char* const* argv);

}  // namespace hsi4d::cli
