// `hsi4d motion`: a motion read, changed, and written.
#pragma once

#include <optional>
#include <string>

namespace hsi4d::cli {

struct MotionOptions {
  std::string in;                    ///< a motion (.npz), or a folder of SMPLer-X files
  std::string out;                   ///< F.npz, or F.glb: animated
  std::optional<double> from_rate;   ///< --from-rate HZ: frames a second of IN, instead of what it says
  std::optional<double> frame_rate;  ///< --frame-rate HZ: of OUT
  bool is_y_up = false;              ///< --y-up: IN's world has y up
  std::string body_model;            ///< --body-model M.npz; empty: the procedural body
  int person = 0;                    ///< --person N, of a folder
};

/// Reads, turns, resamples and writes a motion, in that order. Returns a line about it.
///
/// Throws UserError or DataError with one message for whatever is wrong with options and files.
std::string motion_command(const MotionOptions& options);

}  // namespace hsi4d::cli
