#include "pipelines/synthetic/faults.h"

#include <algorithm>
#include <cmath>

#include "core/random.h"
#include "pipelines/synthetic/surface.h"
#include "pipelines/synthetic/variation.h"

namespace hsi4d {
namespace {

double smooth(double x) {
  const double t = std::clamp(x, 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

bool is_of_hand(const Avatar& avatar, std::size_t gaussian) {
  const auto width = static_cast<std::size_t>(avatar.weights.per_vertex);
  const auto weights = avatar.weights.weights.begin() + static_cast<std::ptrdiff_t>(width * gaussian);
  const auto most = std::max_element(weights, weights + static_cast<std::ptrdiff_t>(width)) - weights;
  const int joint = avatar.weights.indices[width * gaussian + static_cast<std::size_t>(most)];
  return joint == smplx_joint("left_wrist") || joint == smplx_joint("right_wrist") || joint >= 25;
}

float clamped(double x) { return static_cast<float>(std::clamp(x, 0.0, 1.0)); }

/// An image moved sideways and blurred: what a generator might invent for what it does not know.
Image invented(const Image& frame, std::uint64_t seed) {
  const int height = frame.height(), width = frame.width();
  const SmoothNoise noise(seed, "synthetic.revealed");
  Image coarse = resize_area(frame, std::max(4, height / 10), std::max(4, width / 10));
  Image result(3, height, width);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const double u = double(x) / width, v = double(y) / height;
      const double from_u = u + 0.16 + 0.05 * noise.at({u * 7, v * 7, 1}),
                   from_v = v + 0.06 * noise.at({u * 7, v * 7, 5});
      const int i =
          std::clamp(static_cast<int>(std::abs(std::remainder(from_v, 2.0)) * coarse.height()), 0, coarse.height() - 1);
      const int j =
          std::clamp(static_cast<int>(std::abs(std::remainder(from_u, 2.0)) * coarse.width()), 0, coarse.width() - 1);
      const double grain = 0.16 * noise.at({u * 26, v * 26, 9}) + 0.1 * noise.at({u * 55, v * 55, 13});
      for (int c = 0; c < 3; ++c)
        result(c, y, x) = clamped(double(coarse(c, i, j)) * (1 + grain) + 0.08 * noise.at({u * 4, v * 4, 20.0 + c}));
    }
  return result;
}

}  // namespace

Avatar filmed_avatar(const BodyModel& body, const Avatar& tracked, const SyntheticSettings& settings) {
  const double difference = settings.avatar_difference;
  if (difference <= 0) return tracked;
  const auto seed = static_cast<std::uint64_t>(settings.seed);
  const Random random(seed, random_stream("synthetic.filmed"));
  AvatarSettings other;
  other.gaussians = static_cast<Index>(std::lround(double(settings.avatar_gaussians) * (1 + 0.4 * difference)));
  other.seed = random.bits(0) >> 11U;
  Avatar avatar = in_other_clothes(surface_avatar(body, other), settings);
  const SmoothNoise stains(seed, "synthetic.stains");
  for (std::size_t i = 0; i < static_cast<std::size_t>(avatar.count()); ++i) {
    const float* m = avatar.means.data() + 3 * i;
    const Vector3<double> p{double(m[0]), double(m[1]), double(m[2])};
    const double here = 0.03 * difference * stains.at(p * 9);
    for (std::size_t c = 0; c < 3; ++c) {
      const double gain = 1 + 0.05 * difference * (2 * random.uniform(1 + c) - 1);
      avatar.colors[3 * i + c] = clamped(double(avatar.colors[3 * i + c]) * gain + here);
    }
  }
  return avatar;
}

Avatar with_faded_hands(const Avatar& avatar, double share) {
  Avatar result = avatar;
  if (share <= 0) return result;
  for (std::size_t i = 0; i < static_cast<std::size_t>(avatar.count()); ++i) {
    if (!is_of_hand(avatar, i)) continue;
    const double opacity = (1 - share) / (1 + std::exp(-double(avatar.opacity_logits[i])));
    const double logit = opacity <= 0 ? -20 : std::log(opacity / (1 - opacity));
    result.opacity_logits[i] = static_cast<float>(std::clamp(logit, -20.0, 20.0));
  }
  return result;
}

Avatar with_changed_colors(const Avatar& avatar, double share) {
  Avatar result = avatar;
  const double gain[3] = {1.0 - 0.1 * share, 1.0 - 0.32 * share, 1.0 - 0.5 * share};
  for (std::size_t i = 0; i < result.colors.size(); i += 3) {
    const double grey = double(avatar.colors[i] + avatar.colors[i + 1] + avatar.colors[i + 2]) / 3;
    for (std::size_t c = 0; c < 3; ++c) {
      const double pale = double(avatar.colors[i + c]) * (1 - 0.3 * share) + 0.3 * share * grey;
      result.colors[i + c] = clamped(pale * gain[c]);
    }
  }
  return result;
}

double hands_gone(double part) { return smooth((part - 0.25) / 0.15) * smooth((0.8 - part) / 0.15); }

void RevealedContent::apply(SyntheticFrame& frame) {
  if (strength_ <= 0) return;
  const int height = frame.color.height(), width = frame.color.width();
  if (covered_.empty()) {
    covered_ = Image(1, height, width);
    content_ = invented(frame.color, seed_);
  }
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      double shown =
          double(frame.human_mask(0, y, x)) + (frame.object_mask.empty() ? 0.0 : double(frame.object_mask(0, y, x)));
      for (const Image& mask : frame.other_masks) shown += double(mask(0, y, x));
      const double now = std::min(1.0, shown);
      float& covered = covered_(0, y, x);
      const double share = strength_ * std::max(0.0, double(covered) - now);
      covered = std::max(covered, static_cast<float>(now));
      if (share <= 0) continue;
      for (int c = 0; c < 3; ++c) {
        float& color = frame.color(c, y, x);
        color = static_cast<float>(double(color) + share * (double(content_(c, y, x)) - double(color)));
      }
    }
}

}  // namespace hsi4d
