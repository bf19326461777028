#include "bench/tape_operators.h"

#include <cmath>
#include <memory>

#include "autodiff/difference.h"
#include "autodiff/elementwise.h"
#include "autodiff/reduce.h"
#include "autodiff/ssim.h"
#include "body/skinning.h"

namespace hsi4d::detail {

namespace {

template <class S>
void fill(const Array<S>& array, double phase) {
  for (Index r = 0; r < array.total_rows(); ++r) {
    for (Index c = 0; c < array.shape.cols; ++c)
      array.row(r)[c] =
          static_cast<S>(0.5 + 0.4 * std::sin(0.01 * static_cast<double>(r * array.shape.cols + c) + phase));
  }
}

/// Two images on a tape.
struct ImagePair {
  Tape<float> tape;
  Var<float> image, target;

  explicit ImagePair(Index side)
      : image(tape.parameter("image", image_shape<float>(3, side, side))),
        target(tape.constant("target", image_shape<float>(3, side, side))) {
    fill(tape.write(image), 1);
    fill(tape.write(target), 2);
  }
};

}  // namespace

void add_ssim(std::vector<TapeWork>& work) {
  constexpr Index kSide = 1024;
  const auto images = std::make_shared<ImagePair>(kSide);
  const Var<float> loss = d_ssim(images->image, images->target);
  work.push_back({.name = "tape/ssim/both", .elements = kSide * kSide, .goal = 15.26, .run = [images, loss] {
                    images->tape.write(images->image);
                    images->tape.forward(loss);
                    images->tape.backward(loss);
                  }});
}

void add_skinning(std::vector<TapeWork>& work) {
  constexpr Index kVertices = 2000, kJoints = 55, kPerVertex = 4;
  SparseWeights sparse{kVertices, kJoints, kPerVertex, {}, {}};
  for (Index i = 0; i < kVertices * kPerVertex; ++i) {
    sparse.indices.push_back(
        static_cast<std::int32_t>((i / kPerVertex * kJoints / kVertices + i % kPerVertex) % kJoints));
    sparse.weights.push_back(1.0 / kPerVertex);
  }
  const auto weights = std::make_shared<const SkinWeights<double>>(sparse);
  const auto tape = std::make_shared<Tape<double>>();
  const Var<double> joints = tape->parameter("transforms", shape_of(kJoints, 12));
  const Var<double> points = tape->constant("points", shape_of(kVertices, 3));
  fill(tape->write(joints), 1);
  fill(tape->write(points), 2);
  const auto out = std::make_shared<std::vector<double>>(3 * kVertices);
  const Var<double> loss = sum(skin_points(*weights, joints, points));
  work.push_back({.name = "tape/skinning/primal", .elements = kVertices, .run = [=] {
                    skin_points(*weights, tape->value(joints).data, tape->value(points).data, out->data());
                  }});
  work.push_back({.name = "tape/skinning/gradient",
                  .elements = kVertices,
                  .against = "tape/skinning/primal",
                  .goal = 2.5,
                  .run = [=] {
                    tape->write(joints);
                    tape->forward(loss);
                    tape->backward(loss);
                  }});
}

void add_anomaly(std::vector<TapeWork>& work) {
  constexpr Index kSide = 512;
  for (const bool on : {false, true}) {
    const auto images = std::make_shared<ImagePair>(kSide);
    images->tape.set_anomaly(on);
    const Var<float> loss = l1(images->image, images->target) * 0.9 + d_ssim(images->image, images->target) * 0.1;
    TapeWork iteration{
        .name = on ? "tape/anomaly/on" : "tape/anomaly/off", .elements = kSide * kSide, .run = [images, loss] {
          images->tape.write(images->image);
          images->tape.forward(loss);
          images->tape.backward(loss);
        }};
    if (on) {
      iteration.against = "tape/anomaly/off";
      iteration.goal = 1.3;
    }
    work.push_back(std::move(iteration));
  }
}

}  // namespace hsi4d::detail
