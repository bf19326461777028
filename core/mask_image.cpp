#include "core/mask_image.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "core/check.h"
#include "core/image_io.h"
#include "core/png.h"
#include "core/text.h"

namespace hsi4d {
namespace {

constexpr const char* kAllowed =
    "; allowed are a grey mask, a palette image whose index 0 is background, and a mask that is the alpha of one "
    "colour";

int color_channels(const Image& image) { return image.channels() >= 3 ? 3 : 1; }

bool has_alpha(const Image& image) { return image.channels() == 2 || image.channels() == 4; }

/// Of 0 to 255, as programs show it: "(0, 0, 255)".
std::string color_text(float red, float green, float blue) {
  std::vector<std::string> numbers;
  for (const float value : {red, green, blue}) numbers.push_back(rounded(255 * static_cast<double>(value), 4));
  return "(" + joined(numbers) + ")";
}

/// The first pixel (row, column) for which this holds.
template <class Test>
std::optional<std::pair<int, int>> find_pixel(const Image& image, Test test) {
  for (int y = 0; y < image.height(); ++y) {
    for (int x = 0; x < image.width(); ++x) {
      if (test(y, x)) return std::pair{y, x};
    }
  }
  return std::nullopt;
}

void check_grey(const Image& image, const std::string& name) {
  if (color_channels(image) == 1) return;
  const auto pixel = find_pixel(image, [&](int y, int x) {
    const auto [least, most] = std::minmax({image(0, y, x), image(1, y, x), image(2, y, x)});
    return most - least > kGreyTolerance;
  });
  if (!pixel) return;
  const auto [y, x] = *pixel;
  throw DataError(name + ": is a colour mask: row " + std::to_string(y) + ", column " + std::to_string(x) + " is " +
                  color_text(image(0, y, x), image(1, y, x), image(2, y, x)) + kAllowed);
}

bool is_seen(const Image& image, int y, int x) { return image(image.channels() - 1, y, x) > 0; }

/// Whether all pixels that are not fully transparent have one colour; of none, whether all have.
bool has_one_color(const Image& image) {
  const bool shows_any = find_pixel(image, [&](int y, int x) { return is_seen(image, y, x); }).has_value();
  for (int c = 0; c < color_channels(image); ++c) {
    float least = 1, most = 0;
    bool is_first = true;
    find_pixel(image, [&](int y, int x) {
      if (shows_any && !is_seen(image, y, x)) return false;
      least = is_first ? image(c, y, x) : std::min(least, image(c, y, x));
      most = is_first ? image(c, y, x) : std::max(most, image(c, y, x));
      is_first = false;
      return false;
    });
    if (most - least > kGreyTolerance) return false;
  }
  return true;
}

/// Whether colours are grey and say the same as alpha does, as those do that were multiplied by it.
bool agrees_with_alpha(const Image& image) {
  return !find_pixel(image, [&](int y, int x) {
    for (int c = 0; c < color_channels(image); ++c) {
      if (std::fabs(image(c, y, x) - image(image.channels() - 1, y, x)) > kGreyTolerance) return true;
    }
    return false;
  });
}

// ---- Palettes ----

constexpr PaletteColor kBlack = {0, 0, 0, 255};

/// Without its alpha.
bool is_black(const PaletteColor& color) { return color[0] == 0 && color[1] == 0 && color[2] == 0; }

/// The colour of an index; black of one that a damaged palette lacks.
const PaletteColor& color_of(const PaletteImage& image, int index) {
  return static_cast<std::size_t>(index) < image.colors.size() ? image.colors[static_cast<std::size_t>(index)] : kBlack;
}

/// The indices that its pixels have, ascending.
std::vector<int> used_indices(const PaletteImage& image) {
  std::array<bool, 256> is_used{};
  for (const uint8_t index : image.indices) is_used[index] = true;
  std::vector<int> used;
  for (int i = 0; i < 256; ++i) {
    if (is_used[static_cast<std::size_t>(i)]) used.push_back(i);
  }
  return used;
}

/// Whether all of the palette is, used or not: that of labels has colours for those which are not in this picture.
bool is_grey(const PaletteImage& image) {
  return std::all_of(image.colors.begin(), image.colors.end(),
                     [](const PaletteColor& c) { return c[0] == c[1] && c[1] == c[2]; });
}

/// Whether alpha says what indices do not: an index is transparent that would be a grey or a label, or several labels
/// differ in it.
bool tells_by_alpha(const PaletteImage& image, const std::vector<int>& used, bool of_greys) {
  const auto labels = std::count_if(used.begin(), used.end(), [](int i) { return i > 0; });
  return std::any_of(used.begin(), used.end(), [&](int i) {
    const uint8_t alpha = color_of(image, i)[3];
    return alpha < 255 && (of_greys || labels > 1 || (i > 0 && alpha == 0));
  });
}

Image where_index(const PaletteImage& labels, const std::array<bool, 256>& counts) {
  Image mask(1, labels.height, labels.width);
  const uint8_t* index = labels.indices.data();
  for (int y = 0; y < labels.height; ++y) {
    for (int x = 0; x < labels.width; ++x) mask(0, y, x) = counts[*index++] ? 1.0F : 0.0F;
  }
  return mask;
}

/// Nothing where it is a picture of several greys.
std::optional<Image> mask_of_greys(const PaletteImage& image, const std::vector<int>& used) {
  std::array<bool, 256> counts{};
  int shades = 0;
  for (const int i : used) {
    counts[static_cast<std::size_t>(i)] = !is_black(color_of(image, i));
    shades += counts[static_cast<std::size_t>(i)] ? 1 : 0;
  }
  return shades > 1 ? std::nullopt : std::optional(where_index(image, counts));
}

Image mask_of_labels(const PaletteImage& image, const std::vector<int>& used, const std::string& name) {
  std::vector<std::string> labels;
  std::array<bool, 256> counts{};
  for (const int i : used) {
    if (i == 0) continue;
    counts[static_cast<std::size_t>(i)] = true;
    labels.push_back(std::to_string(i));
    if (is_black(color_of(image, i)) && !is_black(color_of(image, 0)))
      throw DataError(name + ": is a colour mask: its palette has black at index " + std::to_string(i) +
                      ", and a colour at index 0, which is background" + kAllowed);
  }
  if (labels.size() > 1)
    throw DataError(name + ": holds the labels " + joined(labels) +
                    "; a mask shows one thing, so allowed are index 0, which is background, and one label");
  return where_index(image, counts);
}

/// Nothing where it is no palette image, or one whose colours and alpha are those of a mask.
std::optional<Image> mask_of_palette(const PaletteImage& image, const std::string& name) {
  if (image.colors.empty()) return std::nullopt;
  const std::vector<int> used = used_indices(image);
  const bool of_greys = is_grey(image);
  if (tells_by_alpha(image, used, of_greys)) return std::nullopt;
  return of_greys ? mask_of_greys(image, used) : mask_of_labels(image, used, name);
}

}  // namespace

Image mask_of(const Image& image, const std::string& name) {
  const int alpha = image.channels() - 1;
  const bool is_transparent =
      has_alpha(image) && find_pixel(image, [&](int y, int x) { return !(image(alpha, y, x) >= 1); });
  if (!is_transparent) {
    check_grey(image, name);
    return take_channels(image, 0, 1);
  }
  if (has_one_color(image) || agrees_with_alpha(image)) return take_channels(image, alpha, 1);
  throw DataError(name + ": both its colours and its alpha vary, and either could be the mask" + kAllowed);
}

Image complement(const Image& mask) {
  Image result(1, mask.height(), mask.width());
  for (int y = 0; y < mask.height(); ++y) {
    for (int x = 0; x < mask.width(); ++x) result(0, y, x) = 1 - mask(0, y, x);
  }
  return result;
}

std::vector<int> label_greys(const Image& mask) {
  constexpr int kWhite = 255, kNear = 16, kMostGreys = 8;
  std::array<Index, kWhite + 1> pixels{};
  for (int y = 0; y < mask.height(); ++y) {
    for (int x = 0; x < mask.width(); ++x)
      ++pixels[static_cast<std::size_t>(std::lround(std::clamp(mask(0, y, x), 0.0F, 1.0F) * kWhite))];
  }
  std::vector<int> greys;
  Index seen = 0, between = 0;
  for (int grey = 1; grey <= kWhite; ++grey) {
    const Index count = pixels[static_cast<std::size_t>(grey)];
    if (count > 0) greys.push_back(grey);
    seen += count;
    if (grey > kNear && grey < kWhite - kNear) between += count;
  }
  if (std::ssize(greys) > kMostGreys || 4 * between < seen) greys.clear();
  return greys;
}

Image read_mask_image(const std::string& path, const ImageLimits& limits) {
  if (is_png(read_file_start(path, 8))) {
    if (std::optional<Image> mask = mask_of_palette(decode_palette(read_file(path), path, limits), path)) return *mask;
  }
  return mask_of(read_image(path, limits), path);
}

}  // namespace hsi4d
