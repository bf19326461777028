#include "pipelines/scan/scan_graph.h"

#include <algorithm>
#include <cmath>

#include "autodiff/elementwise.h"
#include "autodiff/matrix.h"
#include "core/check.h"
#include "core/parallel.h"
#include "core/rotation.h"
#include "optim/metrics.h"
#include "pipelines/draw/tape_image.h"
#include "pipelines/scan/depth_target.h"
#include "splat/render/covariance.h"
#include "splat/render/opacity.h"
#include "splat/render/sh.h"

namespace hsi4d {

namespace {

using S = float;

/// Gain and offset of each channel of what the Gaussians show, not of what is behind them.
/// @param exposure, background  six planes and three, of one number
Var<S> exposed(const Rendered<S>& rendered, Var<S> exposure, Var<S> background) {
  const Var<S> gains = slice_planes(exposure, 0, 3), offsets = slice_planes(exposure, 3, 3);
  const Var<S> behind = rendered.transmittance * background;
  return (rendered.image - behind) * exp(gains) + (1 - rendered.transmittance) * offsets + behind;
}

}  // namespace

ScanGraph::ScanGraph(const Gaussians& g, const Camera& camera, const RenderSettings& settings, int degree,
                     const ScanExtras& extras)
    : view_{camera, g.origin_world, settings} {
  view_.settings.sh_degree = std::min(degree, settings.sh_degree);
  groups_ = {{"means", {leaf("means", g.means, 3)}},
             {"quats", {leaf("quats", g.quats, 4)}},
             {"log_scales", {leaf("log_scales", g.log_scales, 3)}},
             {"opacity_logits", {leaf("opacity_logits", g.opacity_logits, 1)}},
             {"sh", {leaf("sh", g.sh, 3 * g.sh_coefficients())}}};
  xi_ = tape_.constant("xi", shape_of(1, 6));
  intrinsics_ = tape_.constant("intrinsics", shape_of(1, 4));
  background_ = tape_.constant("background", shape_of(1, 3));
  inputs_.gaussian_opacities = gaussian_opacities(group(3));
  inputs_.gaussian_log_scales = group(2);
  record({group(0), gaussian_axes(group(1), group(2)), inputs_.gaussian_opacities,
          sh_colors(group(4), group(0), xi_, view_)},
         extras);
}

void ScanGraph::record(const SplatInputs<S>& splats, const ScanExtras& extras) {
  RenderRequest request;
  request.depth_moments = extras.depth;
  const Rendered<S> rendered = render(splats, xi_, background_, view_, request, intrinsics_);
  means_px_ = rendered.projected.means_px;
  inputs_.rendered = rendered.image;
  inputs_.target = tape_.constant("target", inputs_.rendered.shape());
  if (extras.exposure) {
    exposure_ = tape_.parameter("exposure", {kExposureNumbers, 1, 1, 1});
    background_planes_ = tape_.constant("background_planes", {3, 1, 1, 1});
    inputs_.rendered = exposed(rendered, exposure_, background_planes_);
  }
  const Shape plane = image_shape<S>(1, view_.camera.height, view_.camera.width);
  if (extras.weight) inputs_.weight = tape_.constant("weight", plane);
  if (!extras.depth) return;
  inputs_.depth_moments = rendered.depth_moments;
  inputs_.transmittance = rendered.transmittance;
  inputs_.depth_target = tape_.constant("depth_target", plane);
}

Var<S> ScanGraph::leaf(const char* name, const std::vector<float>& values, Index cols) {
  const Var<S> var = tape_.parameter(name, shape_of(static_cast<Index>(values.size()) / cols, cols));
  tape_.set(var, values);
  return var;
}

void ScanGraph::show(const Photo& photo, const Vector3<double>& background) {
  const Camera& camera = photo.camera;
  const Vector6<double> xi = se3_log(compose(camera.camera_from_world, inverse(view_.camera.camera_from_world)));
  const Array<S> xi_array = tape_.write(xi_), background_array = tape_.write(background_);
  for (Index i = 0; i < 6; ++i) xi_array(0, i) = static_cast<S>(xi[i]);
  for (Index i = 0; i < 3; ++i) background_array(0, i) = static_cast<S>(background[i]);
  if (LossInputs<S>::given(background_planes_))
    tape_.set(background_planes_,
              std::array<S, 3>{background_array(0, 0), background_array(0, 1), background_array(0, 2)});
  tape_.set(intrinsics_, std::array<S, 4>{static_cast<S>(camera.fx), static_cast<S>(camera.fy),
                                          static_cast<S>(camera.cx), static_cast<S>(camera.cy)});
  if (photo.alpha.empty()) {
    write_image(inputs_.target, photo.color);  // no copy of it
  } else {
    write_image(inputs_.target, before_color(photo, background));
  }
  if (LossInputs<S>::given(inputs_.depth_target)) write_depth_target(photo, tape_.write(inputs_.depth_target));
  if (!LossInputs<S>::given(inputs_.weight)) return;
  if (photo.weight.empty()) {
    fill(inputs_.weight, S(1));
  } else {
    write_image(inputs_.weight, photo.weight);
  }
}

void ScanGraph::set_exposure(std::span<const float> numbers) { tape_.set(exposure_, numbers); }

std::vector<float> ScanGraph::exposure_numbers() const {
  const ConstArray<S> planes = tape_.value(exposure_);
  std::vector<float> numbers;
  for (Index i = 0; i < kExposureNumbers; ++i) numbers.push_back(*planes.row(i));
  return numbers;
}

Image ScanGraph::picture() {
  tape_.forward(inputs_.rendered);
  return held_image(tape_.value(inputs_.rendered), 0, 3);
}

double ScanGraph::psnr() const {
  const ConstArray<S> image = tape_.value(inputs_.rendered), target = tape_.value(inputs_.target);
  const bool has_weight = LossInputs<S>::given(inputs_.weight);
  const Index rows = image.shape.rows, cols = image.shape.cols;
  const auto sum_of = [&](bool of_squares) {
    return parallel_sum(rows, 16, [&](Index begin, Index end) {
      double sum = 0;
      for (Index r = begin; r < end; ++r) {
        const S* const w = has_weight ? tape_.value(inputs_.weight).row(r) : nullptr;
        for (Index plane = 0; plane < image.shape.planes; ++plane) {
          const S *a = image.row(plane * rows + r), *b = target.row(plane * rows + r);
          for (Index c = 0; c < cols; ++c) {
            const double weight = w == nullptr ? 1 : static_cast<double>(w[c]);
            sum += of_squares ? weight * static_cast<double>((a[c] - b[c]) * (a[c] - b[c])) : weight;
          }
        }
      }
      return sum;
    });
  };
  const double weights = has_weight ? sum_of(false) : static_cast<double>(image.shape.count());
  return weights > 0 ? std::min(kLargestPsnrDb, -10 * std::log10(sum_of(true) / weights)) : kLargestPsnrDb;
}

void ScanGraph::read(Gaussians& g, std::size_t groups) const {
  const auto arrays = arrays_of(g);
  for (std::size_t i = 0; i < groups; ++i) {
    std::vector<float>* const values = arrays[i];
    const ConstArray<S> leaf = tape_.value(group(i));
    for (Index r = 0; r < leaf.total_rows(); ++r)
      std::copy_n(leaf.row(r), leaf.shape.cols, values->begin() + r * leaf.shape.cols);
  }
}

Image before_color(const Photo& photo, const Vector3<double>& background) {
  Image result = photo.color;
  if (photo.alpha.empty()) return result;
  for (int c = 0; c < 3; ++c) {
    const auto behind = static_cast<float>(background[c]);
    for (int y = 0; y < result.height(); ++y) {
      float* const row = result.row(c, y);
      const float* const alpha = photo.alpha.row(0, y);
      for (int x = 0; x < result.width(); ++x) row[x] = alpha[x] * row[x] + (1 - alpha[x]) * behind;
    }
  }
  return result;
}

}  // namespace hsi4d
