// Loss terms, and the operator of distances, against complex steps of formulas that are written down here a second
// time.
#include <array>
#include <cmath>

#include "autodiff/matrix.h"
#include "core/rotation.h"
#include "optim/solid/distance_grid.h"
#include "optim/solid/gaussian_surface.h"
#include "tests/support/complex_formulas.h"
#include "tests/support/complex_step_check.h"
#include "tests/support/loss_terms.h"
#include "tests/support/test_motion.h"

namespace complex_step_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

using V = Var<double>;
using Vars = std::vector<V>;
using Inputs = LossInputs<double>;

constexpr std::size_t kHeight = 5, kWidth = 7, kPixels = kHeight * kWidth, kObjects = 3;

/// Images of a few pixels.
OperatorInput image(const char* name, Index planes) {
  return {name, image_shape<double>(planes, kHeight, kWidth), 0, 1};
}

/// @param fill  (inputs of the term, Vars of the inputs)
template <class Fill, class Formula>
void check_loss(const std::string& name, const std::vector<OperatorInput>& inputs, const Fill& fill,
                const Formula& formula, double tolerance = 1e-12) {
  check_complex_step(
      inputs,
      [&](const Vars& in) {
        Inputs given;
        given.motion = std::shared_ptr<const MotionStart>(&motion_of_test().start, [](const MotionStart*) {});
        fill(given, in);
        return term_named(name).record(given);
      },
      [&](const ComplexInputs& in) { return Complexes{formula(in)}; },
      {.tolerance = tolerance, .value_tolerance = tolerance, .loss = name});
}

Complex square(Complex x) { return x * x; }

Complex sum_of_squares(const Complexes& a, const Complexes& b) {
  Complex sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += square(a[i] - b[i]);
  return sum;
}

/// x times the weights of its pixels, which all planes share.
Complexes times_weight(const Complexes& x, const Complexes& weight) {
  Complexes y;
  for (std::size_t i = 0; i < x.size(); ++i) y.push_back(x[i] * weight[i % kPixels]);
  return y;
}

Complexes plane_of(const Complexes& x, std::size_t plane) {
  const auto begin = x.begin() + static_cast<std::ptrdiff_t>(plane * kPixels);
  return {begin, begin + kPixels};
}

/// Where the mass of an image lies, pixels.
std::array<Complex, 2> centre_of(const Complexes& opacity) {
  Complex x = 0, y = 0, mass = 0;
  for (std::size_t i = 0; i < kPixels; ++i) {
    mass += opacity[i];
    x += opacity[i] * (static_cast<double>(i % kWidth) + 0.5);
    y += opacity[i] * (static_cast<double>(i / kWidth) + 0.5);
  }
  return {x / mass, y / mass};
}

/// Σ over rows from..to and coordinates of (x_{r+1} − x_r)².
Complex steps_between(const Complexes& joints, std::size_t from, std::size_t to) {
  Complex sum = 0;
  for (std::size_t i = 66 * from; i < 66 * to; ++i) sum += square(joints[i + 66] - joints[i]);
  return sum;
}

constexpr Index kMoving = kFrames - kStill;

/// The row of a Gaussian or vertex of the human, of which there are more.
std::size_t body_row(Index frame, Index row) { return static_cast<std::size_t>((frame - kStill) * kVertexRows + row); }
std::size_t object_row(const ObjectPoint& p) {
  return static_cast<std::size_t>(((p.frame - kStill) * 2 + p.object) * kObjectRows + p.row);
}

/// The rows that a term asks for, of all places of the body.
std::function<V(const std::vector<BodyPoint>&)> points_of(V places) {
  return [places](const std::vector<BodyPoint>& points) {
    std::vector<std::uint32_t> rows;
    for (const BodyPoint& p : points) rows.push_back(static_cast<std::uint32_t>(body_row(p.frame, p.row)));
    return gather_rows(places, rows);
  };
}

/// The same of the objects.
std::function<V(const std::vector<ObjectPoint>&)> object_points_of(V places) {
  return [places](const std::vector<ObjectPoint>& points) {
    std::vector<std::uint32_t> rows;
    for (const ObjectPoint& p : points) rows.push_back(static_cast<std::uint32_t>(object_row(p)));
    return gather_rows(places, rows);
  };
}

const OperatorInput kBodyPlaces = {"body_places", shape_of(kMoving* kVertexRows, 3)};

/// Trilinear between the nodes of a grid, where the numbers are floats; nothing where one is not known.
/// @param distance  of a place, metres
template <class F>
Complex trilinear(const F& distance, double cell, const Complex* place) {
  Vector3<double> corner;
  std::array<Complex, 3> within;
  for (int i = 0; i < 3; ++i) {
    const Complex cells = place[i] / cell;
    corner[i] = std::floor(cells.real());
    within[static_cast<std::size_t>(i)] = cells - corner[i];
  }
  Complex sum = 0;
  for (unsigned node = 0; node < 8; ++node) {
    Complex weight = 1;
    Vector3<double> at = corner;
    for (unsigned i = 0; i < 3; ++i) {
      const bool upper = (node >> i & 1U) != 0;
      at[i] += upper ? 1 : 0;
      weight *= upper ? within[i] : 1.0 - within[i];
    }
    const auto value = static_cast<double>(static_cast<float>(distance(Vector3<double>(at * cell))));
    if (std::isnan(value)) return kFarDistance;
    sum += weight * value;
  }
  return sum;
}

}  // namespace

TEST_CASE("loss terms of images have the gradients of complex steps") {
  const std::vector<OperatorInput> pixels = {image("rendered", 3), image("target", 3), image("weight", 1)};
  const auto fill = [](Inputs& given, const Vars& in) {
    given.rendered = in[0], given.target = in[1], given.weight = in[2];
  };
  check_loss("photometric", pixels, fill, [](const ComplexInputs& in) {
    const Complexes a = times_weight(in[0], in[2]), b = times_weight(in[1], in[2]);
    Complex difference = 0, structure = 0;
    for (std::size_t i = 0; i < a.size(); ++i) difference += complex_abs(a[i] - b[i]) / (3.0 * kPixels);
    for (std::size_t c = 0; c < 3; ++c)
      structure += plain_d_ssim(plane_of(a, c), plane_of(b, c), kHeight, kWidth)[0] / 3.0;
    return 0.9 * difference + 0.1 * structure;
  });
  check_loss("masked_l2", pixels, fill, [](const ComplexInputs& in) {
    Complex sum = 0;
    for (std::size_t i = 0; i < in[0].size(); ++i) sum += in[2][i % kPixels] * square(in[0][i] - in[1][i]);
    return sum / (3.0 * kPixels);
  });
  check_loss(
      "mask",
      {image("human_opacity", 1),
       image("human_mask", 1),
       {"human_seen", kScalarShape, 0, 0, {1}},
       image("object_opacity", kObjects),
       image("object_masks", kObjects),
       {"object_seen", {kObjects, 1, 1, 1}, 0, 0, {1, 0, 1}}},
      [](Inputs& given, const Vars& in) {
        given.human_opacity = in[0], given.human_mask = in[1], given.human_seen = in[2];
        given.object_opacity = in[3], given.object_masks = in[4], given.object_seen = in[5];
      },
      [](const ComplexInputs& in) {
        Complex sum = in[2][0] * sum_of_squares(in[0], in[1]);
        for (std::size_t o = 0; o < kObjects; ++o)
          sum += in[5][o] * sum_of_squares(plane_of(in[3], o), plane_of(in[4], o));
        return sum / static_cast<double>(kPixels * (1 + kObjects));
      });
}

TEST_CASE("loss terms of objects have the gradients of complex steps") {
  check_loss(
      "center",
      {image("object_opacity", kObjects),
       {"object_center_target", shape_of(kObjects, 3), 0, 0, {4.5, 2, 1, 1.25, 3.5, 1, 0, 0, 0}}},
      [](Inputs& given, const Vars& in) { given.object_opacity = in[0], given.object_center_target = in[1]; },
      [](const ComplexInputs& in) {
        Complex sum = 0;
        for (std::size_t o = 0; o + 1 < kObjects; ++o) {  // the last is not in the frame
          const auto [x, y] = centre_of(plane_of(in[0], o));
          sum += square(x - in[1][3 * o]) + square(y - in[1][3 * o + 1]);
        }
        return sum / static_cast<double>(kObjects);
      });
  check_complex_step(
      {image("object_opacity", kObjects),
       {"object_center_target", shape_of(kObjects, 3), 0, 0, {4.5, 2, 1, 1.25, 3.5, 0.3, 0, 0, 0}},
       {"object_place", shape_of(kObjects, 2), 0, 5}},
      [](const Vars& in) {
        Inputs given;
        given.object_opacity = in[0], given.object_center_target = in[1], given.object_place = in[2];
        return record_term("center", given, R"({"moves": "object", "by_share": true})");
      },
      [](const ComplexInputs& in) {
        Complex sum = 0;
        for (std::size_t o = 0; o + 1 < kObjects; ++o) {
          const auto [x, y] = centre_of(plane_of(in[0], o));
          const Complex* place = in[2].data() + 2 * o;
          const Complex* target = in[1].data() + 3 * o;
          const Complex moved_x = x.real() + place[0] - place[0].real();
          const Complex moved_y = y.real() + place[1] - place[1].real();
          sum += target[2] * (square(moved_x - target[0]) + square(moved_y - target[1]));
        }
        return Complexes{sum / static_cast<double>(kObjects)};
      },
      {.loss = "center"});
  // What a pixel of the 7 x 5 is, along x and y.
  for (const auto& [unit, pixel] : {std::pair{"pixels", std::array{1.0, 1.0}},
                                    {"widths", std::array{1.0 / kWidth, 1.0 / kWidth}},
                                    {"ndc", std::array{2.0 / kWidth, 2.0 / kHeight}}}) {
    for (const bool is_l1 : {false, true}) {
      const std::string settings =
          std::string(R"({"unit": ")") + unit + R"(", "norm": ")" + (is_l1 ? "l1" : "squared") + R"("})";
      check_complex_step(
          {image("object_opacity", kObjects),
           {"object_center_target", shape_of(kObjects, 3), 0, 0, {4.5, 2, 1, 1.25, 3.5, 1, 0, 0, 0}}},
          [&](const Vars& in) {
            Inputs given;
            given.object_opacity = in[0], given.object_center_target = in[1];
            return record_term("center", given, settings);
          },
          [&, size = pixel](const ComplexInputs& in) {
            Complex sum = 0;
            for (std::size_t o = 0; o + 1 < kObjects; ++o) {
              const auto [x, y] = centre_of(plane_of(in[0], o));
              const Complex right = size[0] * (x - in[1][3 * o]), down = size[1] * (y - in[1][3 * o + 1]);
              const auto length = [](Complex z) { return z.real() < 0 ? -z : z; };
              sum += is_l1 ? length(right) + length(down) : square(right) + square(down);
            }
            return Complexes{sum / static_cast<double>(kObjects)};
          },
          {.loss = "center"});
    }
  }
  check_loss(
      "depth", {{"object_depth", shape_of(3, 1), 1, 3}, {"object_depth_target", shape_of(3, 1), 1, 3}},
      [](Inputs& given, const Vars& in) { given.object_depth = in[0], given.object_depth_target = in[1]; },
      [](const ComplexInputs& in) { return sum_of_squares(in[0], in[1]) / 3.0; });
}

TEST_CASE("contact has the gradients of complex steps, of vertices and of Gaussians") {
  const MotionStart& motion = motion_of_test().start;
  const BodySet of = GENERATE(BodySet::kVertices, BodySet::kGaussians);
  const Index rows = of == BodySet::kVertices ? kVertexRows : kBodyRows;
  const std::string settings =
      std::string(R"({"points": ")") + (of == BodySet::kVertices ? "vertices" : "gaussians") + R"("})";
  check_complex_step(
      {{"joints", shape_of(kFrames, 66)}, kBodyPlaces, {"object_places", shape_of(kMoving * 2 * kObjectRows, 3)}},
      [&settings](const Vars& in) {
        Inputs given;
        given.motion = std::shared_ptr<const MotionStart>(&motion_of_test().start, [](const MotionStart*) {});
        given.joints = in[0];
        given.body_points = points_of(in[1]);
        given.object_points = object_points_of(in[2]);
        return record_term("contact", given, settings);
      },
      [&motion, of, rows](const ComplexInputs& in) {
        Complex total = 0;
        for (Index t = kStill; t < kFrames; ++t) {
          Complex sum = 0;
          double pairs = 0;
          for (Index row = 0; row < rows; ++row) {
            if (!is_hand_joint(row % kSmplxJoints)) continue;
            ObjectPoint nearest;
            double least = 0.05;
            for (const Index object : {0, 1}) {
              for (Index r = 0; r < kObjectRows; ++r) {
                const ObjectPoint p{t, object, r};
                const double distance = (motion.place(p) - motion.place(BodyPoint{t, row, of})).norm();
                if (distance < least) least = distance, nearest = p;
              }
            }
            if (!(least < 0.05)) continue;
            pairs += 1;
            for (std::size_t i = 0; i < 3; ++i)
              sum += square(in[1][3 * body_row(t, row) + i] - in[2][3 * object_row(nearest) + i]);
          }
          if (pairs > 0) total += sum / pairs / static_cast<double>(kMoving);
        }
        return Complexes{total};
      },
      {.loss = "contact"});
}

TEST_CASE("grip has the gradients of complex steps") {
  const MotionStart& motion = motion_of_test().start;
  check_complex_step(
      {{"joints", shape_of(kFrames, 66)}, {"object_places", shape_of(kMoving * 2 * kObjectRows, 3)}},
      [](const Vars& in) {
        Inputs given;
        given.motion = std::shared_ptr<const MotionStart>(&motion_of_test().start, [](const MotionStart*) {});
        given.joints = in[0];
        given.object_points = object_points_of(in[1]);
        return record_term("grip", given, R"({"scale": 0.5})");
      },
      [&motion](const ComplexInputs& in) {
        Complex total = 0;
        for (Index t = kStill - 1; t + 1 < kFrames; ++t) {
          for (const Index wrist : kWristJoints) {  // both are at the first object, which does not turn
            Complex squared = 0;
            for (Index i = 0; i < 3; ++i) {
              const auto joint = [&](Index frame) {
                return in[0][static_cast<std::size_t>(66 * frame + 3 * wrist + i)];
              };
              const double start = motion.body_in(t).joints[static_cast<std::size_t>(3 * wrist + i)];
              const Complex carried = in[1][3 * object_row({t + 1, 0, 0}) + static_cast<std::size_t>(i)];
              squared += square(joint(t + 1) - carried - (joint(t) - start));
            }
            total += 0.25 * squared / (0.25 + squared);
          }
        }
        return Complexes{total / static_cast<double>(kMoving)};
      },
      {.loss = "grip"});
}

TEST_CASE("a loss term of the objects' motion has the gradients of complex steps") {
  const MotionStart& motion = motion_of_test().start;
  std::vector<std::pair<Index, Index>> furthest;  // object, row
  for (const Index object : {0, 1}) {
    const std::vector<float>& means = motion.objects[static_cast<std::size_t>(object)]->means;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      std::vector<std::pair<float, Index>> along;
      for (Index row = 0; row < kObjectRows; ++row)
        along.emplace_back(means[static_cast<std::size_t>(3 * row) + axis], row);
      std::sort(along.begin(), along.end());
      furthest.emplace_back(object, along.front().second);
      furthest.emplace_back(object, along.back().second);
    }
  }
  check_loss(
      "object_smooth", {{"object_places", shape_of(kMoving * 2 * kObjectRows, 3)}},
      [](Inputs& given, const Vars& in) { given.object_points = object_points_of(in[0]); },
      [&](const ComplexInputs& in) {
        const auto place = [&](const ObjectPoint& p, int i) {
          return p.frame < kStill ? Complex(motion.place(p)[i])
                                  : in[0][3 * object_row(p) + static_cast<std::size_t>(i)];
        };
        Complex sum = 0;
        for (Index t = kStill; t < kFrames; ++t) {
          for (const auto& [object, row] : furthest) {
            for (int i = 0; i < 3; ++i)
              sum += square(place({t, object, row}, i) - 2.0 * place({t - 1, object, row}, i) +
                            place({t - 2, object, row}, i));
          }
        }
        return sum / static_cast<double>(furthest.size() * kMoving);
      });
}

TEST_CASE("loss terms of joints have the gradients of complex steps") {
  const std::vector<OperatorInput> joints = {{"joints", shape_of(kFrames, 66)}};
  const auto fill = [](Inputs& given, const Vars& in) { given.joints = in[0]; };
  check_loss(
      "fit", {joints[0], {"joints_start", shape_of(kFrames, 66)}},
      [](Inputs& given, const Vars& in) { given.joints = in[0], given.joints_start = in[1]; },
      [](const ComplexInputs& in) { return sum_of_squares(in[0], in[1]) / static_cast<double>(kMoving); });
  check_loss("smooth", joints, fill, [](const ComplexInputs& in) {
    return steps_between(in[0], kStill - 1, kFrames - 1) / static_cast<double>(kMoving);
  });
  check_loss(
      "smooth", {joints[0], {"joints_after", shape_of(2, 66)}},
      [](Inputs& given, const Vars& in) { given.joints = in[0], given.joints_after = in[1]; },
      [](const ComplexInputs& in) {
        Complex sum = steps_between(in[0], kStill - 1, kFrames - 1);
        for (std::size_t i = 0; i < 66; ++i) sum += square(in[1][i] - in[0][66 * (kFrames - 1) + i]);
        return sum / static_cast<double>(kMoving + 1);
      });
  check_loss("foot_sliding", joints, fill, [](const ComplexInputs& in) {  // all feet stand
    Complex sum = 0;
    for (std::size_t t = kStill - 1; t + 1 < kFrames; ++t) {
      for (std::size_t i = 0; i < 66; ++i)
        sum += is_foot_joint(static_cast<Index>(i / 3)) ? square(in[0][66 * (t + 1) + i] - in[0][66 * t + i]) : 0;
    }
    return sum / static_cast<double>(kMoving);
  });
  check_loss(
      "ground", {joints[0], kBodyPlaces},
      [](Inputs& given, const Vars& in) { given.joints = in[0], given.body_points = points_of(in[1]); },
      [](const ComplexInputs& in) {
        const std::vector<Index> feet =
            rows_of_joints(motion_of_test().avatar.weights, is_foot_joint);  // fewer than count
        Complex sum = 0;
        for (Index t = kStill; t < kFrames; ++t) {
          Complex rise = 0;
          for (const Index row : feet)
            rise += in[1][3 * body_row(t, row) + 2] - motion_of_test().start.place(BodyPoint{kFirstFrame, row})[2];
          sum += square(rise / static_cast<double>(feet.size()));
        }
        return sum / static_cast<double>(kMoving);
      });
}

TEST_CASE("loss terms of Gaussians have the gradients of complex steps") {
  const std::vector<OperatorInput> inputs = {{"gaussian_opacities", shape_of(7, 1), 0, 1},
                                             {"gaussian_log_scales", shape_of(7, 3), -4, 0}};
  const auto fill = [](Inputs& given, const Vars& in) {
    given.gaussian_opacities = in[0];
    given.gaussian_log_scales = in[1];
  };
  check_loss("gaussian_opacity", inputs, fill, [](const ComplexInputs& in) {
    Complex sum = 0;
    for (const Complex& opacity : in[0]) sum += opacity;
    return sum / 7.0;
  });
  check_loss("gaussian_scale", inputs, fill, [](const ComplexInputs& in) {
    Complex sum = 0;
    for (const Complex& size : in[1]) sum += std::exp(size);
    return sum / 21.0;
  });
}

TEST_CASE("the loss of depths has the gradients of complex steps") {
  const std::vector<OperatorInput> inputs = {{"depth_moments", image_shape<double>(2, 3, 4), 0.2, 0.3},
                                             {"transmittance", image_shape<double>(1, 3, 4), 0, 0.5},
                                             {"depth_target", image_shape<double>(1, 3, 4), 1, 2}};
  const auto fill = [](Inputs& given, const Vars& in) {
    given.depth_moments = in[0];
    given.transmittance = in[1];
    given.depth_target = in[2];
  };
  check_loss("depth_spread", inputs, fill, [](const ComplexInputs& in) {
    constexpr float kFloor = 0.002F;
    Complex sum = 0;
    for (std::size_t i = 0; i < 12; ++i) {
      const Complex &z = in[0][i], &zz = in[0][12 + i], &t = in[1][i], &d = in[2][i];
      sum += std::sqrt(zz / (d * d) - 2.0 * z / d + 1.0 - t + static_cast<double>(kFloor * kFloor)) -
             static_cast<double>(kFloor);
    }
    return sum / 12.0;
  });
}

TEST_CASE("the loss of depth maps has the gradients of complex steps") {
  std::vector<double> depths, map;
  for (int i = 0; i < 12; ++i) {
    depths.push_back(2 + std::sin(0.7 * i));
    map.push_back(1.3 * depths.back() - 2.7 + 0.4 * std::sin(0.9 * i * i));
  }
  const std::vector<OperatorInput> inputs = {{"depth", image_shape<double>(1, 3, 4), 0, 0, depths},
                                             {"transmittance", image_shape<double>(1, 3, 4), 0, 0.5},
                                             {"depth_map", image_shape<double>(1, 3, 4), 0, 0, map},
                                             {"depth_map_weight", image_shape<double>(1, 3, 4), 0.2, 1}};
  const auto fill = [](Inputs& given, const Vars& in) {
    given.depth = in[0], given.transmittance = in[1], given.depth_map = in[2], given.depth_map_weight = in[3];
  };
  check_loss("depth_map", inputs, fill, [](const ComplexInputs& in) {
    const auto sum_of = [&in](const auto& term) {  // Σ v term(q, p)
      Complex sum = 0;
      for (std::size_t i = 0; i < 12; ++i) sum += in[3][i] * (1.0 - in[1][i]) * term(in[0][i], in[2][i]);
      return sum;
    };
    const Complex total = sum_of([](Complex, Complex) { return 1.0; }) + 1e-6,
                  q = sum_of([](Complex z, Complex) { return z; }) / total,
                  p = sum_of([](Complex, Complex m) { return m; }) / total,
                  scale = sum_of([&](Complex z, Complex m) { return (z - q) * (m - p); }) /
                          (sum_of([&](Complex z, Complex) { return square(z - q); }) + 1e-8 * total);
    constexpr double kScale = static_cast<double>(0.1F), kLimit = static_cast<double>(0.1F * 0.1F);
    return sum_of([&](Complex z, Complex m) {
             const Complex r = scale * (z - q) + p - m;
             return r.real() * r.real() <= kLimit ? r * r : 2.0 * kScale * complex_abs(r) - kLimit;
           }) /
           total;
  });
}

TEST_CASE("the loss of tracks has the gradients of complex steps") {
  const std::vector<OperatorInput> inputs = {
      {"tracks", shape_of(3, 2), 1, 20}, {"tracks_target", shape_of(3, 3), 0, 0, {3, 5, 1, 14, 9, 0.6, 12, 3, 0.8}}};
  const auto fill = [](Inputs& given, const Vars& in) { given.tracks = in[0], given.tracks_target = in[1]; };
  check_loss("tracks", inputs, fill, [](const ComplexInputs& in) {
    Complex sum = 0;
    for (std::size_t i = 0; i < 3; ++i) {
      const Complex squared = square(in[0][2 * i] - in[1][3 * i]) + square(in[0][2 * i + 1] - in[1][3 * i + 1]);
      sum += in[1][3 * i + 2] * 100.0 * squared / (100.0 + squared);
    }
    return sum / 3.0;
  });
}

TEST_CASE("loss terms of poses have the gradients of complex steps") {
  std::vector<double> matrices;
  for (int j = 0; j < 21; ++j) {
    const double size = 0.4 + 0.1 * j;
    const Matrix3<double> r = so3_exp(Vector3<double>(size * std::sin(1.0 + j), size * std::cos(2.0 * j), -0.3 * size));
    for (int i = 0; i < 9; ++i) matrices.push_back(r(i / 3, i % 3));
  }
  const std::vector<OperatorInput> rotations = {{"body_rotations", shape_of(21, 9), 0, 0, matrices}};
  const auto fill = [](Inputs& given, const Vars& in) { given.body_rotations = in[0]; };
  const auto matrix_at = [](const Complexes& x, std::size_t row) {
    Matrix3<Complex> m;
    for (int i = 0; i < 9; ++i) m(i / 3, i % 3) = x[9 * row + static_cast<std::size_t>(i)];
    return m;
  };
  check_loss(
      "joint_limits", rotations, fill,
      [&](const ComplexInputs& in) {
        Complex sum = 0;
        for (std::size_t j = 0; j < 21; ++j) sum += plain_excess(matrix_at(in[0], j), natural_joints()[j]);
        return sum;
      },
      1e-11);
  check_loss(
      "pose_prior", rotations, fill,
      [&](const ComplexInputs& in) {
        constexpr double kRadians = 3.14159265358979323846 / 180;
        Complex sum = 0;
        for (std::size_t j = 0; j < 21; ++j) {
          const NaturalJoint& joint = natural_joints()[j];
          const Matrix3<double> ease = so3_exp(Vector3<double>(Vector3<double>(joint.ease) * kRadians));
          const Matrix3<Complex> turned = ease.transpose().cast<Complex>() * matrix_at(in[0], j);
          const Vector3<Complex> w = so3_log(turned);
          for (int i = 0; i < 3; ++i) sum += square(w[i] / (joint.spread[i] * kRadians));
        }
        return sum;
      },
      1e-10);
}

TEST_CASE("distances have the gradients of complex steps") {
  const auto ball = [](const Vector3<double>& place) { return place.norm() - 0.2; };
  const auto grid = std::make_shared<DistanceGrid>(
      ball, DistanceGrid::Settings{.cell = 0.05, .reach = 1, .most_bytes = Index{1} << 24U, .name = "ball"});
  check_complex_step(
      {{"points", shape_of(20, 3), -0.3, 0.3}}, [&grid](const Vars& in) { return sampled_distance(in[0], grid); },
      [&ball](const ComplexInputs& in) {
        Complexes y;
        for (std::size_t n = 0; n < 20; ++n) y.push_back(trilinear(ball, 0.05, &in[0][3 * n]));
        return y;
      });
  const MotionStart& motion = motion_of_test().start;
  std::vector<Vector3<double>> free = {motion.first_camera_center};
  for (std::size_t i = 0; i < motion.first_body.joints.size(); i += 3)
    free.emplace_back(motion.first_body.joints.data() + i);
  const GaussianDistance floor(facing(surface_discs(*motion.scene), free), 0.1);
  check_loss(
      "penetration", {{"joints", shape_of(kFrames, 66)}, {"body_places", kBodyPlaces.shape, -0.35, -0.1}},
      [](Inputs& given, const Vars& in) { given.joints = in[0], given.body_points = points_of(in[1]); },
      [&floor](const ComplexInputs& in) {
        Complex sum = 0;
        for (std::size_t n = 0; n < in[1].size() / 3; ++n) {
          if (static_cast<Index>(n) % kVertexRows >= kBodyRows) continue;  // no Gaussian
          const auto at = [&floor](const Vector3<double>& place) { return floor.at(place); };
          const Complex distance = trilinear(at, 0.02, &in[1][3 * n]);
          if (distance.real() < 0) sum += square(distance);
        }
        return sum / static_cast<double>(kMoving * kBodyRows);
      });
}

}  // namespace complex_step_test
