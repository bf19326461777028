// Rows F11, F12: numbers that come from files.
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <memory>
#include <string>

#include "core/check.h"
#include "core/config_parse.h"
#include "core/formatted.h"
#include "core/random.h"
#include "splat/files/io_ply.h"
#include "stress/rows.h"

namespace hsi4d::stress {

namespace {

/// Ten Gaussians as a PLY file.
std::vector<std::uint8_t> ten_gaussians() {
  Gaussians g;
  RandomSequence random(11);
  const auto fill = [&](std::vector<float>& numbers, Index count) {
    for (Index i = 0; i < count; ++i) numbers.push_back(static_cast<float>(random.uniform(-2, 2)));
  };
  fill(g.means, 30);
  fill(g.quats, 40);
  fill(g.log_scales, 30);
  fill(g.opacity_logits, 10);
  fill(g.sh, 30);
  return encode_ply(g);
}

bool all_finite(const std::vector<float>& numbers) {
  return std::all_of(numbers.begin(), numbers.end(), [](float x) { return std::isfinite(x); });
}

/// What readers make of broken files.
struct Readings {
  double not_finite = 0;      ///< files from which a number came that is none
  double beyond_the_end = 0;  ///< files of which bytes were read, or counted on, that are not there
  double unclear = 0;         ///< files that ended in another error than a DataError, or whose rows do not add up
};

void read_checked(const std::vector<std::uint8_t>& file, Readings& readings) {
  try {
    const SplatFile read = decode_ply(file, "a.ply");
    const Gaussians& g = read.gaussians;
    const bool is_finite = all_finite(g.means) && all_finite(g.quats) && all_finite(g.log_scales) &&
                           all_finite(g.opacity_logits) && all_finite(g.sh);
    readings.not_finite += is_finite ? 0 : 1;
    readings.unclear += g.count() + read.report.rejected == read.report.rows ? 0 : 1;
    readings.beyond_the_end += 4 * 14 * read.report.rows > std::ssize(file) ? 1 : 0;
  } catch (const DataError&) {  // as it should
  } catch (const std::exception&) {
    readings.unclear += 1;
  }
}

/// Takes the header's count and every float as they are; stops where the file does, which a program without a check
/// would not.
void read_trusting(const std::vector<std::uint8_t>& file, Readings& readings) {
  const std::string text(file.begin(), file.end());
  const std::size_t header = text.find("end_header\n"), count_at = text.find("element vertex ");
  if (header == std::string::npos || count_at == std::string::npos) return;
  const auto rows = std::strtoull(text.c_str() + count_at + 15, nullptr, 10);
  const std::size_t begin = header + 11, there = (file.size() - begin) / sizeof(float);
  const double wanted = static_cast<double>(rows) * 17;
  readings.beyond_the_end += wanted > static_cast<double>(there) ? 1 : 0;
  bool is_finite = true;
  for (std::size_t i = 0; i < there; ++i) {
    float x = 0;
    std::memcpy(&x, file.data() + begin + sizeof(float) * i, sizeof(float));
    is_finite = is_finite && std::isfinite(x);
  }
  readings.not_finite += is_finite ? 0 : 1;
}

/// The number that JSON text holds, or NaN where it is refused.
template <class S>
S read_back(const std::string& text, Remedy remedy) {
  const auto number = [](const std::string& digits) {
    if constexpr (std::is_same_v<S, float>)
      return std::strtof(digits.c_str(), nullptr);
    else
      return std::strtod(digits.c_str(), nullptr);
  };
  if (remedy == Remedy::kOff) return number(text);
  ConfigProblems problems;
  ConfigValue value;
  const bool is_json = parse_config_text(text, std::make_shared<ConfigSource>(), problems, value);
  if (!is_json || !problems.empty() || value.kind != ConfigValue::Kind::kNumber) {
    return std::numeric_limits<S>::quiet_NaN();
  }
  return number(value.text);
}

template <class S>
bool comes_back(S x, Remedy remedy) {
  const std::string text =
      remedy == Remedy::kOn ? to_json_line(ConfigValue::make_number(x)) : formatted("%g", static_cast<double>(x));
  return read_back<S>(text, remedy) == x;
}

/// Whether a number that is none is written, and read again as one.
bool is_written(double x, Remedy remedy) {
  if (remedy == Remedy::kOff) return !std::isfinite(read_back<double>(formatted("%g", x), remedy));
  try {
    ConfigValue::make_number(x);
    return true;
  } catch (const InternalError&) {
    return false;
  }
}

}  // namespace

std::vector<StressFigure> broken_ply(Remedy remedy) {
  const std::vector<std::uint8_t> good = ten_gaussians();
  Readings readings;
  const auto read = [&](const std::vector<std::uint8_t>& file) {
    remedy == Remedy::kOn ? read_checked(file, readings) : read_trusting(file, readings);
  };
  for (std::size_t i = 0; i < good.size(); ++i) {
    for (const int change : {0xFF, 0x80, 0x01}) {
      std::vector<std::uint8_t> file = good;
      file[i] = static_cast<std::uint8_t>(file[i] ^ change);
      read(file);
    }
  }
  for (std::size_t size = 0; size < good.size(); size += 3) {
    read({good.begin(), good.begin() + static_cast<std::ptrdiff_t>(size)});
  }
  for (const std::uint32_t bits : {0x7FC00000u, 0x7F800000u, 0xFF800000u}) {  // NaN and infinities, one at a time
    for (std::size_t at = good.size() - 680; at < good.size(); at += 4) {
      std::vector<std::uint8_t> file = good;
      std::memcpy(file.data() + at, &bits, sizeof bits);
      read(file);
    }
  }
  return {{"files that give numbers which are none", readings.not_finite, 0},
          {"files of which rows are taken that are not there", readings.beyond_the_end, 0},
          {"files that end otherwise than in a clear error", readings.unclear, 0}};
}

std::vector<StressFigure> numbers_in_json(Remedy remedy) {
  const Random random(12);
  double different = 0, accepted = 0;
  for (std::uint64_t i = 0; i < 50000; ++i) {
    const auto x = std::bit_cast<double>(random.bits(2 * i));
    const auto y = std::bit_cast<float>(static_cast<std::uint32_t>(random.bits(2 * i + 1)));
    if (std::isfinite(x)) different += comes_back(x, remedy) ? 0 : 1;
    if (std::isfinite(y)) different += comes_back(y, remedy) ? 0 : 1;
  }
  for (const double x : {5e-324, 2.2250738585072009e-308, std::numeric_limits<double>::max(), -0.0}) {
    different += comes_back(x, remedy) ? 0 : 1;
  }
  for (const char* text : {"NaN", "nan", "Infinity", "-Infinity", "inf", "1e999", "-1e999", "22e2222"}) {
    const double x = read_back<double>(text, remedy);
    accepted += remedy == Remedy::kOn ? (std::isnan(x) ? 0 : 1) : (std::isfinite(x) ? 0 : 1);
  }
  for (const double x : {std::nan(""), std::numeric_limits<double>::infinity()}) {
    accepted += is_written(x, remedy) ? 1 : 0;
  }
  return {{"numbers of 100,000 that come back different", different, 0},
          {"numbers that are none, read or written, of 10", accepted, 0}};
}

}  // namespace hsi4d::stress
