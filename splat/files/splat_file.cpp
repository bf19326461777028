#include "splat/files/splat_file.h"

#include <algorithm>
#include <functional>
#include <string_view>

#include "core/check.h"
#include "core/file.h"
#include "core/log.h"
#include "core/text.h"
#include "splat/files/far_means.h"

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

constexpr std::int64_t kMagicBytes = 16;
constexpr const char* kUnreadEnding = ".ksplat";

const SplatFormat* format_where(const std::function<bool(const SplatFormat&)>& is_meant) {
  const auto found = std::find_if(splat_formats().begin(), splat_formats().end(), is_meant);
  return found == splat_formats().end() ? nullptr : &*found;
}

const SplatFormat* format_by_ending(const std::string& path) {
  const SplatFormat* longest = nullptr;
  for (const SplatFormat& format : splat_formats()) {
    if (ends_in(path, format.ending) && (longest == nullptr || format.ending.size() > longest->ending.size()))
      longest = &format;
  }
  return longest;
}

/// By what a file of any name begins with. Gzip may hold something else.
const SplatFormat* format_by_magic(std::span<const std::uint8_t> file) {
  return format_where([&](const SplatFormat& format) {
    return std::any_of(format.magic.begin(), format.magic.end(),
                       [&](const std::string& magic) { return begins_with(file, magic); });
  });
}

/// The format that reads a file; null if none does.
const SplatFormat* format_of_file(std::span<const std::uint8_t> file, const std::string& name) {
  if (const SplatFormat* begun = format_by_magic(file)) return begun;
  const SplatFormat* named = format_by_ending(name);
  if (named != nullptr && named->magic.empty()) return named;  // any bytes: a .splat's first are a coordinate
  if (begins_with(file, "\x1f\x8b")) return format_where([](const SplatFormat& format) { return format.gzip; });
  return named;  // whose reader says what is wrong with the first bytes
}

std::string last_ending(const SplatFormat& format) { return format.ending.substr(format.ending.rfind('.')); }

/// ".ply (INRIA's and compressed)"; the ending alone if its formats have no kinds.
std::string ending_with_kinds(const std::string& ending, const std::string& between) {
  std::string kinds;
  for (const SplatFormat& format : splat_formats()) {
    if (last_ending(format) == ending) kinds += (kinds.empty() ? "" : between) + format.kind;
  }
  return kinds.empty() ? ending : ending + " (" + kinds + ")";
}

}  // namespace

const std::vector<SplatFormat>& splat_formats() {
#define HSI4D_SPLAT_FORMAT(name) name##_format(),
  static const std::vector<SplatFormat> formats = {HSI4D_SPLAT_FORMATS};
#undef HSI4D_SPLAT_FORMAT
  return formats;
}

std::vector<std::string> splat_endings() {
  std::vector<std::string> endings;
  for (const SplatFormat& format : splat_formats()) {
    const std::string ending = last_ending(format);
    if (std::find(endings.begin(), endings.end(), ending) == endings.end()) endings.push_back(ending);
  }
  return endings;
}

std::vector<std::string> written_splat_endings() {
  std::vector<std::string> endings;
  for (const SplatFormat& format : splat_formats()) endings.push_back(format.ending);
  return endings;
}

std::string splat_formats_text(const std::string& between, const std::string& last) {
  std::vector<std::string> texts = splat_endings();
  for (std::string& text : texts) text = ending_with_kinds(text, between);
  return joined(texts, last);
}

std::string splat_type_name() {
  std::string text;
  for (const std::string& ending : splat_endings()) text += (text.empty() ? "" : ",") + ending.substr(1);
  return "F.{" + text + "}";
}

bool has_splat_ending(const std::string& path) { return format_by_ending(path) != nullptr; }

bool is_splat_file(const std::string& path) {
  if (has_splat_ending(path) || ends_in(path, kUnreadEnding)) return true;
  try {
    return format_by_magic(read_file_start(path, kMagicBytes)) != nullptr;
  } catch (const UserError&) {
    return false;
  }
}

int written_sh_degree(const std::string& path, int sh_degree) {
  const SplatFormat* format = format_by_ending(path);
  return format == nullptr ? sh_degree : std::min(sh_degree, format->sh_degree);
}

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
  if (const SplatFormat* format = format_of_file(file, name)) return format->decode(file, name, origin_world);
  if (ends_in(name, kUnreadEnding))
    throw UserError(name + ": " + kUnreadEnding + " files are not read; Gaussians are read from " +
                    splat_formats_text() + ", into which the tool that wrote it can convert it");
  throw UserError(name + ": is no file of Gaussians that is known; they are read from " + splat_formats_text());
}

EncodedSplats encode_splats(const std::string& path, const Gaussians& gaussians, const SplatWriteOptions& options) {
  if (const SplatFormat* format = format_by_ending(path)) return format->encode(gaussians, options);
  throw UserError(path +
                  ": Gaussians are not written to files of this ending; allowed: " + joined(written_splat_endings()));
}

Counts write_splats(const std::string& path, const Gaussians& gaussians, const SplatWriteOptions& options) {
  EncodedSplats encoded = encode_splats(path, gaussians, options);
  write_file(path, encoded.bytes);
  return std::move(encoded.losses);
}

}  // namespace hsi4d
