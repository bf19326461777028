// What a reconstruction came to, as text.
#pragma once

#include <filesystem>
#include <string>

#include "pipelines/scan/scan.h"

namespace hsi4d {

/// summary.json: {"name", "gaussians", "iterations", "width", "height", "seconds",
///   "learnt": {"pictures", "psnr_db", "ssim"}, "held": {...}, "curve_psnr_db": [...],
///   "pictures": [{"name", "held", "psnr_db", "ssim"}, ...]}
std::string scan_summary_json(const ScanSummary& summary);

/// The page: figures, the curve, the pictures that were held back beside how they are shown.
std::string scan_report_page(const ScanSummary& summary);

/// The names, in the folder `views`, of a picture as it is shown and as it was taken.
/// @param photo  its place in the order of names, so that no two are alike
std::string view_file(std::size_t photo, const std::string& name);
std::string photo_file(std::size_t photo, const std::string& name);

}  // namespace hsi4d
