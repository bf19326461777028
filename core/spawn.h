// How other programs are started as children: by core/process.h and core/background_program.h.
#pragma once

#include <string>
#include <vector>

namespace hsi4d {

/// The standard descriptors of a child, as numbers of ours. None of them may be 0, 1 or 2 (see beyond_standard).
struct ChildDescriptors {
  int input = -1, output = -1, error_output = -1;
};

/// Starts a program in a process group of its own, so that what the terminal sends to us (Ctrl-C) is for us to pass on.
/// SIGINT, SIGTERM, SIGUSR1 and SIGCHLD do to it what they usually do, also where we ignore some of them (a shell that
/// starts a job with & has it ignore SIGINT), which it would take over.
/// @param command  the program, looked up in PATH, and its arguments; no shell is involved
/// @param pid      receives its process
/// @return  0, or the number of the error for which it could not be started
int spawn_program(const std::vector<std::string>& command, const ChildDescriptors& descriptors, int& pid);

/// The same file at a number that is none of the standard ones, which a child gets others at; closed on exec. A
/// negative number stays.
int beyond_standard(int descriptor);

}  // namespace hsi4d
