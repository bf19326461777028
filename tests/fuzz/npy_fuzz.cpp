#include <array>
#include <string>

#include "core/npy.h"
#include "tests/fuzz/fuzz.h"

namespace hsi4d::fuzz::npy_fuzz {
namespace {

Bytes with_header(const std::string& dict, const std::string& data) {
  std::string file("\x93NUMPY\x01\x00", 8);
  file += static_cast<char>(dict.size());
  file += '\0';
  file += dict + data;
  return Bytes(file.begin(), file.end());
}

}  // namespace

std::vector<Bytes> corpus() {
  const std::array<int64_t, 2> shape = {2, 3};
  const std::array<float, 6> numbers = {1, 2, 3, 4, 5, 6};
  const std::array<std::string, 6> texts = {"a", "", "\xc3\xa4", "left hand", "x", "y"};
  return {
      encode_npy(shape, std::span<const float>(numbers)),
      encode_npy(shape, std::span<const std::string>(texts)),
      with_header("{'descr': '>i2', 'fortran_order': True, 'shape': (2, 3), }", "abcdefghijkl"),
      with_header("{'descr': '<f2', 'fortran_order': True, 'shape': (2, 1, 3), }", "abcdefghijkl"),
      with_header("{'descr': '|b1', 'fortran_order': False, 'shape': (), }", "\1"),
      with_header("{'descr': '|S3', 'fortran_order': False, 'shape': (2,), }", "abcdef"),
  };
}

bool accepts(std::span<const uint8_t> file) {
  return is_read([&] {
    const NpyResult result = decode_npy(Bytes(file.begin(), file.end()), "fuzz.npy");
    if (!result.array) return;
    const bool is_text = result.array->kind() == NpyKind::bytes || result.array->kind() == NpyKind::unicode;
    if (is_text) {
      result.array->strings();
    } else {
      result.array->as<double>();
      is_read([&] { result.array->as<int32_t>(); });
      is_read([&] { result.array->as<uint64_t>(); });
      is_read([&] { result.array->as<float>(); });
    }
  });
}

const Target target("npy", corpus, accepts);

}  // namespace hsi4d::fuzz::npy_fuzz
