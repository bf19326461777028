// What the readers of all file formats give: Gaussians, and what became of the file's rows.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "splat/gaussians.h"

namespace hsi4d {

/// Reasons and how often each applies, in a fixed order.
using Counts = std::vector<std::pair<std::string, Index>>;

/// What a reader did to the rows of a file.
struct SplatReport {
  std::string format;                      ///< "INRIA PLY", "compressed PLY", ".splat", ".spz version 3"
  Index rows = 0;                          ///< of the file
  Index rejected = 0;                      ///< rows that are left out
  Counts rejections;                       ///< reason, rows; a row counts under its first reason
  Counts repairs;                          ///< what was put right, numbers
  bool antialiased = false;                ///< the file says: trained with opacities compensated for the blur
  std::vector<std::string> cautions;       ///< why the Gaussians may be others than the file means
  std::vector<std::string> notes;          ///< what else the file says, without effect on the Gaussians
  std::vector<Index> row_of;               ///< the file's row of every kept Gaussian, ascending
  std::vector<Index> held_log_scales;      ///< places in log_scales [N,3] of numbers held at a limit, ascending
  std::vector<Index> held_opacity_logits;  ///< places in opacity_logits [N] of such numbers, ascending
};

/// "12 of 340 Gaussians are left out (a mean that is not finite: 2, ...); held: ...", or nothing without cause.
std::string summary_text(const SplatReport& report);

/// "reason: 3, reason: 4".
std::string counts_text(const Counts& counts);

/// A file's Gaussians, kept rows in the file's order, relative to the origin that was asked for, 0 if none was.
struct SplatFile {
  Gaussians gaussians;
  SplatReport report;
};

}  // namespace hsi4d
