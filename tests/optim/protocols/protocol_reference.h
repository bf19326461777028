// The protocols of public benchmarks again, slow and plain: by their words alone, in double, without Eigen and without
// anything of the library. Rotations are eigenvectors of quaternions [Horn 1987], nearest points are found by looking
// at all, accelerations are those of points that were moved.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>
#include <vector>

namespace hsi4d::test {

using PlainPoint = std::array<double, 3>;
using PlainPoints = std::vector<PlainPoint>;
using PlainFrames = std::vector<PlainPoints>;

inline double plain_distance(const PlainPoint& a, const PlainPoint& b) {
  return std::sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) + (a[2] - b[2]) * (a[2] - b[2]));
}

inline double plain_mean(const std::vector<double>& numbers) {
  double sum = 0;
  for (const double number : numbers) sum += number;
  return sum / static_cast<double>(numbers.size());
}

/// y = s R (x − a) + b.
struct PlainSimilarity {
  std::array<PlainPoint, 3> rotation = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
  double scale = 1;
  PlainPoint from = {}, to = {};

  PlainPoint operator()(const PlainPoint& x) const {
    PlainPoint y = to;
    for (std::size_t r = 0; r < 3; ++r) {
      for (std::size_t c = 0; c < 3; ++c) y[r] += scale * rotation[r][c] * (x[c] - from[c]);
    }
    return y;
  }
};

/// The eigenvector of the largest eigenvalue of a symmetric matrix, by Jacobi's rotations.
inline std::array<double, 4> plain_top_eigenvector(std::array<std::array<double, 4>, 4> m) {
  std::array<std::array<double, 4>, 4> v = {{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}}};
  for (int sweep = 0; sweep < 60; ++sweep) {
    for (std::size_t p = 0; p < 4; ++p) {
      for (std::size_t q = p + 1; q < 4; ++q) {
        if (m[p][q] == 0) continue;
        const double angle = 0.5 * std::atan2(2 * m[p][q], m[q][q] - m[p][p]);
        const double c = std::cos(angle), s = std::sin(angle);
        for (std::size_t k = 0; k < 4; ++k) {
          const double a = m[k][p], b = m[k][q];
          m[k][p] = c * a - s * b;
          m[k][q] = s * a + c * b;
        }
        for (std::size_t k = 0; k < 4; ++k) {
          const double a = m[p][k], b = m[q][k];
          m[p][k] = c * a - s * b;
          m[q][k] = s * a + c * b;
        }
        for (std::size_t k = 0; k < 4; ++k) {
          const double a = v[k][p], b = v[k][q];
          v[k][p] = c * a - s * b;
          v[k][q] = s * a + c * b;
        }
      }
    }
  }
  std::size_t best = 0;
  for (std::size_t k = 1; k < 4; ++k) {
    if (m[k][k] > m[best][best]) best = k;
  }
  return {v[0][best], v[1][best], v[2][best], v[3][best]};
}

inline PlainPoint plain_middle(const PlainPoints& points) {
  PlainPoint middle = {};
  for (const PlainPoint& point : points) {
    for (std::size_t i = 0; i < 3; ++i) middle[i] += point[i] / static_cast<double>(points.size());
  }
  return middle;
}

/// The best in least squares; never a mirror.
inline PlainSimilarity plain_fit(const PlainPoints& from, const PlainPoints& to, bool with_scale) {
  PlainSimilarity fit;
  fit.from = plain_middle(from);
  fit.to = plain_middle(to);
  std::array<std::array<double, 3>, 3> s = {};  // Σ x yᵀ
  double size = 0;
  for (std::size_t i = 0; i < from.size(); ++i) {
    for (std::size_t r = 0; r < 3; ++r) {
      size += (from[i][r] - fit.from[r]) * (from[i][r] - fit.from[r]);
      for (std::size_t c = 0; c < 3; ++c) s[r][c] += (from[i][r] - fit.from[r]) * (to[i][c] - fit.to[c]);
    }
  }
  const std::array<double, 4> q =
      plain_top_eigenvector({{{s[0][0] + s[1][1] + s[2][2], s[1][2] - s[2][1], s[2][0] - s[0][2], s[0][1] - s[1][0]},
                              {s[1][2] - s[2][1], s[0][0] - s[1][1] - s[2][2], s[0][1] + s[1][0], s[2][0] + s[0][2]},
                              {s[2][0] - s[0][2], s[0][1] + s[1][0], s[1][1] - s[0][0] - s[2][2], s[1][2] + s[2][1]},
                              {s[0][1] - s[1][0], s[2][0] + s[0][2], s[1][2] + s[2][1], s[2][2] - s[0][0] - s[1][1]}}});
  const double w = q[0], x = q[1], y = q[2], z = q[3];
  fit.rotation = {{{w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)},
                   {2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)},
                   {2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z}}};
  if (!with_scale) return fit;
  double along = 0;
  for (std::size_t i = 0; i < from.size(); ++i) {
    const PlainPoint turned = fit(from[i]);
    for (std::size_t r = 0; r < 3; ++r) along += (turned[r] - fit.to[r]) * (to[i][r] - fit.to[r]);
  }
  fit.scale = size > 0 ? along / size : 0;
  return fit;
}

inline PlainPoints plain_together(const PlainFrames& frames, std::size_t begin, std::size_t end) {
  PlainPoints all;
  for (std::size_t t = begin; t < end; ++t) all.insert(all.end(), frames[t].begin(), frames[t].end());
  return all;
}

/// The errors of pieces, a number a frame, metres.
inline std::vector<double> plain_piece_errors(const PlainFrames& frames, const PlainFrames& truth, std::size_t piece,
                                              std::size_t aligned) {
  std::vector<double> errors;
  for (std::size_t begin = 0; begin < frames.size(); begin += piece) {
    const std::size_t end = std::min(begin + piece, frames.size()), laid = std::min(begin + aligned, end);
    const PlainSimilarity fit =
        plain_fit(plain_together(frames, begin, laid), plain_together(truth, begin, laid), true);
    for (std::size_t t = begin; t < end; ++t) {
      std::vector<double> distances;
      for (std::size_t j = 0; j < frames[t].size(); ++j)
        distances.push_back(plain_distance(fit(frames[t][j]), truth[t][j]));
      errors.push_back(plain_mean(distances));
    }
  }
  return errors;
}

/// Of a way, percent of its length.
inline std::vector<double> plain_way_errors(const PlainPoints& way, const PlainPoints& truth) {
  double length = 0;
  for (std::size_t t = 0; t + 1 < truth.size(); ++t) length += plain_distance(truth[t], truth[t + 1]);
  const PlainSimilarity fit = plain_fit(way, truth, false);
  std::vector<double> errors;
  for (std::size_t t = 0; t < way.size(); ++t) errors.push_back(plain_distance(fit(way[t]), truth[t]) / length * 100);
  return errors;
}

/// Steps of points whose truth steps by less than 1 cm, metres; one after the other.
inline std::vector<double> plain_standing_steps(const PlainFrames& frames, const PlainFrames& truth) {
  std::vector<double> steps;
  for (std::size_t t = 1; t < frames.size(); ++t) {
    for (std::size_t p = 0; p < frames[t].size(); ++p) {
      if (plain_distance(truth[t][p], truth[t - 1][p]) < 0.01)
        steps.push_back(plain_distance(frames[t][p], frames[t - 1][p]));
    }
  }
  return steps;
}

/// The mean size of third derivatives over ten.
inline double plain_jitter(const PlainFrames& frames, double rate) {
  std::vector<double> sizes;
  for (std::size_t t = 3; t < frames.size(); ++t) {
    for (std::size_t j = 0; j < frames[t].size(); ++j) {
      PlainPoint third = {};
      for (std::size_t i = 0; i < 3; ++i)
        third[i] = (frames[t][j][i] - 3 * frames[t - 1][j][i] + 3 * frames[t - 2][j][i] - frames[t - 3][j][i]) * rate *
                   rate * rate;
      sizes.push_back(plain_distance(third, {}));
    }
  }
  return plain_mean(sizes) / 10;
}

inline double plain_chamfer(const PlainPoints& a, const PlainPoints& b) {
  const auto one_way = [](const PlainPoints& from, const PlainPoints& to) {
    std::vector<double> nearest;
    for (const PlainPoint& point : from) {
      double least = std::numeric_limits<double>::infinity();
      for (const PlainPoint& other : to) least = std::min(least, plain_distance(point, other));
      nearest.push_back(least);
    }
    return plain_mean(nearest);
  };
  return one_way(a, b) + one_way(b, a);
}

/// Frames moved onto others in pieces, human and object by one similarity.
inline std::array<PlainFrames, 2> plain_laid(const std::array<PlainFrames, 2>& frames,
                                             const std::array<PlainFrames, 2>& truth, std::size_t window) {
  std::array<PlainFrames, 2> laid = frames;
  for (std::size_t begin = 0; begin < frames[0].size(); begin += window) {
    const std::size_t end = std::min(begin + window, frames[0].size());
    PlainPoints from = plain_together(frames[0], begin, end), to = plain_together(truth[0], begin, end);
    const PlainPoints more = plain_together(frames[1], begin, end), its = plain_together(truth[1], begin, end);
    from.insert(from.end(), more.begin(), more.end());
    to.insert(to.end(), its.begin(), its.end());
    const PlainSimilarity fit = plain_fit(from, to, true);
    for (PlainFrames& part : laid) {
      for (std::size_t t = begin; t < end; ++t) {
        for (PlainPoint& point : part[t]) point = fit(point);
      }
    }
  }
  return laid;
}

/// The mean of accelerations' errors within pieces, a piece counting as often as it has frames; metres a frame².
inline double plain_acceleration(const PlainFrames& frames, const PlainFrames& truth, std::size_t window) {
  std::vector<double> by_frame;
  for (std::size_t begin = 0; begin < frames.size(); begin += window) {
    const std::size_t end = std::min(begin + window, frames.size());
    std::vector<double> errors;
    for (std::size_t t = begin + 2; t < end; ++t) {
      for (std::size_t p = 0; p < frames[t].size(); ++p) {
        PlainPoint own = {}, its = {};
        for (std::size_t i = 0; i < 3; ++i) {
          own[i] = frames[t - 2][p][i] - 2 * frames[t - 1][p][i] + frames[t][p][i];
          its[i] = truth[t - 2][p][i] - 2 * truth[t - 1][p][i] + truth[t][p][i];
        }
        errors.push_back(plain_distance(own, its));
      }
    }
    if (!errors.empty()) by_frame.insert(by_frame.end(), end - begin, plain_mean(errors));
  }
  return plain_mean(by_frame);
}

// ---- Between plain points and arrays ----

inline std::vector<double> numbers_of(const PlainPoints& points) {
  std::vector<double> numbers;
  for (const PlainPoint& point : points) numbers.insert(numbers.end(), point.begin(), point.end());
  return numbers;
}

inline PlainPoints plain_of(const std::vector<double>& numbers) {
  PlainPoints points;
  for (std::size_t i = 0; i < numbers.size(); i += 3) points.push_back({numbers[i], numbers[i + 1], numbers[i + 2]});
  return points;
}

/// The first points of each frame.
inline PlainFrames first_of_each(const PlainFrames& frames, std::size_t count) {
  PlainFrames first;
  for (const PlainPoints& frame : frames)
    first.emplace_back(frame.begin(), frame.begin() + static_cast<std::ptrdiff_t>(count));
  return first;
}

/// Frames as spans, with what these look at.
struct FrameArrays {
  std::vector<std::vector<double>> numbers;
  std::vector<std::span<const double>> spans;
  explicit FrameArrays(const PlainFrames& frames) {
    for (const PlainPoints& frame : frames) numbers.push_back(numbers_of(frame));
    for (const std::vector<double>& frame : numbers) spans.emplace_back(frame);
  }
  FrameArrays(const FrameArrays&) = delete;
};

}  // namespace hsi4d::test
