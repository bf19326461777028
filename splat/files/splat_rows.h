// Rows of a file become Gaussians: the checks and repairs that all formats share.
#pragma once

#include <array>

#include "splat/files/splat_report.h"
#include "splat/limits.h"

namespace hsi4d {

/// A Gaussian as a file has it.
struct SplatRow {
  static constexpr int kMostSh = 3 * (kHighestShDegree + 1) * (kHighestShDegree + 1);
  std::array<double, 3> mean{};  ///< in the file's digits
  std::array<float, 3> log_scale{};
  std::array<float, 4> quat{};  ///< wxyz
  float opacity_logit = 0;
  std::array<float, kMostSh> sh{};  ///< [K,3], the first K of the file's degree
};

/// The repair of a reader that leaves out harmonics above kHighestShDegree.
inline constexpr const char* kWithoutDegree4 = "Gaussians without their harmonics of degree 4";

class SplatRows;

/// Tells by a caution of what a file has beside what is read of it.
void caution_of_others(const std::vector<std::string>& names, SplatRows& rows);

/// Takes rows one by one into Gaussians that have room for all. A row is left out, and counted, when a number of it is
/// not finite (an opacity of ±inf is) or its quaternion is zero; opacity logits and log-scales beyond
/// ±kOpacityLogitLimit and ±kLogScaleLimit are held there, and counted.
class SplatRows {
 public:
  /// Room for `rows` rows, whose number the caller has checked against the file's size.
  /// @param origin_world  what means become relative to before they are rounded
  SplatRows(Index rows, int sh_degree, std::string format, const Vector3<double>& origin_world);

  /// The next row of the file.
  void take(const SplatRow& row);

  /// A note, caution or repair of the reader's own, told after those of the rows.
  void add_note(std::string note) { file_.report.notes.push_back(std::move(note)); }
  void add_caution(std::string caution) { file_.report.cautions.push_back(std::move(caution)); }
  void set_antialiased() { file_.report.antialiased = true; }
  void add_repair(std::string reason, Index count) { more_repairs_.emplace_back(std::move(reason), count); }

  /// What was taken; once, at the end.
  SplatFile finish();

 private:
  int why_rejected(const SplatRow& row, const std::array<float, 3>& mean) const;
  void store(const SplatRow& row, const std::array<float, 3>& mean, Index n);
  void resize(Index rows);

  SplatFile file_;
  Counts more_repairs_;
  Index next_row_ = 0;
  bool is_finer_ = false;  // a mean has more digits than a float
  std::array<Index, 6> rejections_{};
};

}  // namespace hsi4d
