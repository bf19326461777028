#include "core/file_kind.h"

#include <algorithm>
#include <array>
#include <string_view>

#include "core/safetensors.h"

namespace hsi4d {

namespace {

constexpr std::size_t kLooked = 4096;  // bytes

struct Beginning {
  std::string_view bytes;
  const char* kind;
};

constexpr std::array kBeginnings = {Beginning{"PK\3\4", "a .npz or .zip archive"},
                                    Beginning{"PK\5\6", "a .npz or .zip archive"},
                                    Beginning{"\x93NUMPY", "a .npy array"},
                                    Beginning{"glTF", "a .glb model"},
                                    Beginning{"ply\n", "a .ply file"},
                                    Beginning{"ply\r\n", "a .ply file"},
                                    Beginning{"NGSP", "a .spz file"},
                                    Beginning{"\x89PNG", "a PNG image"},
                                    Beginning{"\xff\xd8\xff", "a JPEG image"},
                                    Beginning{"\x76\x2f\x31\x01", "an OpenEXR image"},
                                    Beginning{"\x89HDF", "an HDF5 file"},
                                    Beginning{"%PDF", "a PDF document"},
                                    Beginning{"\x1f\x8b", "a gzip file"},
                                    Beginning{"BZh", "a bzip2 file"},
                                    Beginning{"\xfd"
                                              "7zXZ",
                                              "an xz file"},
                                    Beginning{"7z\xbc\xaf", "a 7z archive"},
                                    Beginning{"MATLAB ", "a MATLAB file"},
                                    Beginning{"\x80\2", "a Python pickle"},
                                    Beginning{"\x80\3", "a Python pickle"},
                                    Beginning{"\x80\4", "a Python pickle"},
                                    Beginning{"\x80\5", "a Python pickle"},
                                    Beginning{"Kaydara FBX", "an FBX model"}};

/// Its metadata's "format", with a space before it and in brackets, if that is at the header's beginning.
std::string format_of(std::string_view start) {
  constexpr std::string_view kKey = "\"format\":";
  const std::size_t at = start.find(kKey);
  if (at == std::string_view::npos) return "";
  start.remove_prefix(at + kKey.size());
  start.remove_prefix(std::min(start.find_first_not_of(' '), start.size()));
  if (!start.starts_with('"')) return "";
  const std::string_view word = start.substr(1, start.find('"', 1) - 1);
  const bool is_plain = word.size() < 40 && std::all_of(word.begin(), word.end(), [](char c) {
                          return c == ' ' || c == '_' || (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z');
                        });
  return is_plain ? " (" + std::string(word) + ")" : "";
}

/// Printable ASCII, or UTF-8 beyond it.
bool is_text(std::string_view start) {
  return !start.empty() &&
         std::all_of(start.begin(), start.end(),
                     [](char c) {
                       const auto byte = static_cast<unsigned char>(c);
                       return c == '\n' || c == '\r' || c == '\t' || (byte >= 0x20 && byte < 0x7f) || byte >= 0x80;
                     }) &&
         std::count_if(start.begin(), start.end(), [](char c) { return static_cast<unsigned char>(c) >= 0x80; }) * 4 <
             static_cast<std::ptrdiff_t>(start.size());
}

}  // namespace

std::string file_kind(std::span<const std::uint8_t> file) {
  const std::string start(file.begin(), file.begin() + static_cast<std::ptrdiff_t>(std::min(file.size(), kLooked)));
  if (looks_like_safetensors(file)) return "a .safetensors file" + format_of(start);
  for (const Beginning& beginning : kBeginnings) {
    if (start.starts_with(beginning.bytes)) return beginning.kind;
  }
  if (!is_text(start)) return "";
  const std::size_t first = start.find_first_not_of(" \t\r\n");
  return first != std::string::npos && (start[first] == '{' || start[first] == '[') ? "JSON" : "text";
}

std::string other_kind(std::span<const std::uint8_t> file, const std::string& wanted) {
  const std::string kind = file_kind(file);
  return kind.empty() ? "" : "looks like " + kind + ", not like " + wanted;
}

}  // namespace hsi4d
