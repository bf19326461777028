#include "splat/files/splat_file.h"

#include <algorithm>
#include <string_view>

#include "core/check.h"
#include "core/file.h"
#include "core/log.h"
#include "splat/files/far_means.h"
#include "splat/files/io_compressed_ply.h"
#include "splat/files/io_ply.h"
#include "splat/files/io_splat.h"

namespace hsi4d {
namespace {

bool ends_in(const std::string& path, std::string_view ending) {
  const auto lower = [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; };
  return path.size() >= ending.size() &&
         std::equal(ending.rbegin(), ending.rend(), path.rbegin(), [&](char e, char p) { return e == lower(p); });
}

bool begins_with(std::span<const std::uint8_t> file, std::string_view text) {
  return file.size() >= text.size() &&
         std::equal(text.begin(), text.end(), file.begin(),
                    [](char c, std::uint8_t byte) { return c == static_cast<char>(byte); });
}

/// Whether a file of any name begins as one of Gaussians does. Gzip may hold something else.
bool begins_as_splats(std::span<const std::uint8_t> file) {
  return begins_with(file, "ply\n") || begins_with(file, "ply\r") || begins_with(file, "NGSP");
}

}  // namespace

bool has_splat_ending(const std::string& path) {
  return ends_in(path, ".ply") || ends_in(path, ".splat") || ends_in(path, ".spz");
}

bool is_splat_file(const std::string& path) {
  if (has_splat_ending(path) || ends_in(path, ".ksplat")) return true;
  try {
    return begins_as_splats(read_file_start(path, 4));
  } catch (const UserError&) {
    return false;
  }
}

int written_sh_degree(const std::string& path, int sh_degree) { return ends_in(path, ".splat") ? 0 : sh_degree; }

SplatFile read_splats(const std::string& path, const Vector3<double>& origin_world) {
  return decode_splats(read_file(path), path, origin_world);
}

SplatFile read_splats_with_warnings(const std::string& path, const Vector3<double>& origin_world) {
  SplatFile file = read_splats(path, origin_world);
  const std::string text = summary_text(file.report);
  if (!text.empty()) log_warning(path + ": " + text);
  for (const std::string& caution : file.report.cautions) log_warning(path + ": " + caution);
  return file;
}

void warn_of_antialiasing(std::span<const std::string> files, bool antialias) {
  for (const std::string& file : files) {
    if (!antialias)
      log_warning(file +
                  ": its Gaussians were trained with antialiasing and are drawn without it, too opaque where they "
                  "are small; render.antialias=true draws them as they were trained");
  }
}

SplatFile decode_splats(std::span<const std::uint8_t> file, const std::string& name,
                        const Vector3<double>& origin_world) {
  if (begins_with(file, "ply\n") || begins_with(file, "ply\r")) return decode_ply(file, name, origin_world);
  if (begins_with(file, "NGSP")) return decode_spz(file, name, origin_world);
  if (ends_in(name, ".splat")) return decode_splat(file, name, origin_world);  // any bytes: its first are a coordinate
  if (begins_with(file, "\x1f\x8b")) return decode_spz(file, name, origin_world);
  if (ends_in(name, ".ply"))
    return decode_ply(file, name, origin_world);  // which says what is wrong with its first line
  if (ends_in(name, ".spz")) return decode_spz(file, name, origin_world);
  if (ends_in(name, ".ksplat"))
    throw UserError(name + ": .ksplat files are not read; Gaussians are read from " + kSplatFormats +
                    ", into which the tool that wrote it can convert it");
  throw UserError(name + ": is no file of Gaussians that is known; they are read from " + kSplatFormats);
}

EncodedSplats encode_splats(const std::string& path, const Gaussians& gaussians, const SplatWriteOptions& options) {
  if (ends_in(path, ".compressed.ply")) return encode_compressed_ply(gaussians);
  if (ends_in(path, ".ply")) {
    EncodedSplats encoded{encode_ply(gaussians), {}};
    add_loss(encoded.losses, "means in steps wider than their Gaussian",
             far_means(gaussians, gaussians.origin_world).count);
    return encoded;
  }
  if (ends_in(path, ".splat")) return encode_splat(gaussians);
  if (ends_in(path, ".spz")) return encode_spz(gaussians, options.spz);
  throw UserError(path +
                  ": Gaussians are not written to files of this ending; allowed: .ply, .compressed.ply, .splat, .spz");
}

Counts write_splats(const std::string& path, const Gaussians& gaussians, const SplatWriteOptions& options) {
  EncodedSplats encoded = encode_splats(path, gaussians, options);
  write_file(path, encoded.bytes);
  return std::move(encoded.losses);
}

}  // namespace hsi4d
