// The exit statuses of the program, which other programs rely on, a sweep's launcher among them.
#pragma once

namespace hsi4d::exit_status {

inline constexpr int kDone = 0;
inline constexpr int kRowsFailed = 1;  ///< of `hsi4d stress` or `hsi4d gradcheck`, or bounds broken of functions
inline constexpr int kUserMistake = 2;
inline constexpr int kOurBug = 3;
inline constexpr int kElsewhere = 75;  ///< of `hsi4d run-one --parent`: another process computes the run
inline constexpr int kInterrupted = 130;

}  // namespace hsi4d::exit_status
