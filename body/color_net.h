// The color net: colours of a human's Gaussians that follow the pose [method, section 3].
//
//   RGB_n = sigmoid(logit(c_n) + MLP(f_n, v_n, code))
//
// c is the colour that the avatar has in itself, f a feature of each Gaussian, v the direction of view in the axes of
// the rest pose (optional), and the code tells the pose: R_j − I, nine numbers each of the body's joints, 0 in the rest
// pose; neither heading nor place is in it, nor jaw, eyes and fingers. One network is shared by all Gaussians.
//
// A new network changes nothing: its last layer is zero, so that RGB = c to rounding. Features begin as waves over the
// rest pose's place,
//
//   f_2k, f_2k+1 = sin, cos(2π q_k · x)           [random Fourier features: Tancik et al. 2020]
//
// with directions of q at random and |q| from kLowestFrequency to kHighestFrequency, so that neighbours are coloured
// alike also where features never move.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "autodiff/mlp.h"
#include "core/safetensors.h"

namespace hsi4d {

/// Colours of an avatar are held this far from 0 and 1 before the logit: a quarter of a step of 8 bits. Beyond them
/// they have no gradient, so that who moves colours has to keep them in this range (ParameterGroup::range).
inline constexpr double kLeastColor = 1e-3, kLargestColor = 1 - kLeastColor;
/// Waves a metre of the first features.
inline constexpr double kLowestFrequency = 0.25, kHighestFrequency = 4;

/// The network of a new avatar.
struct ColorNetShape {
  Index features = 16;
  Index hidden_width = 32;
  Index hidden_layers = 2;
  bool view_direction = false;
  std::uint64_t seed = 0;
};

/// Numbers of a color net, in double, so that a run in any precision can go on with its own bits. In files they are
/// float32.
struct ColorNet {
  struct Layer {
    Index inputs = 0, outputs = 0;
    std::vector<double> weights;  ///< [inputs, outputs]; those of the first layer are feature, direction, code
    std::vector<double> bias;     ///< [outputs]
    bool operator==(const Layer&) const = default;
  };
  Index rows = 0, features_per_row = 0;
  std::vector<double> features;  ///< [N,F]
  std::vector<int> code_joints;  ///< joints that the code tells of, ascending
  bool view_direction = false;
  std::vector<Layer> layers;  ///< the last one gives 3 numbers

  Index code_size() const { return 9 * static_cast<Index>(code_joints.size()); }
  bool operator==(const ColorNet&) const = default;
};

/// A network that changes nothing yet; a function of the arguments alone.
///
/// @param means   [N,3] metres, rest pose
/// @param joints  of the skeleton; the code tells of joints 1 to 21, those of SMPL-X's body, as far as there are
/// Throws InternalError for a shape without feature, hidden width, or with more layers than an MLP has.
ColorNet new_color_net(std::span<const float> means, Index joints, const ColorNetShape& shape);

/// Throws InternalError when the sizes do not fit each other.
void check_sizes(const ColorNet& net);

/// The same network with the features of these rows. Throws InternalError for a row that is not there.
ColorNet selected(const ColorNet& net, std::span<const Index> rows);

/// A color net on a tape.
template <class S>
struct ColorNetVars {
  Var<S> features;  ///< [N,F]
  std::vector<MlpLayer<S>> layers;
};

/// Leaves for the numbers of `net`, written.
template <class S>
ColorNetVars<S> color_net_leaves(Tape<S>& tape, const ColorNet& net);

/// The leaves' numbers back into `net`, whose shape they have: the features, or weights and biases.
template <class S>
void read_features(const ColorNetVars<S>& vars, ColorNet& net);
template <class S>
void read_layers(const ColorNetVars<S>& vars, ColorNet& net);

/// R_j − I of the joints, one row.
///
/// @param rotations  [J,9] of the joints relative to their parents
/// @return           [1, 9 · joints]
/// Adjoint: rotations. Throws InternalError when a joint is not of them.
template <class S>
Var<S> pose_code(Var<S> rotations, std::span<const int> joints, Source where = Source::current());

/// Colours of the Gaussians.
///
/// @param colors      [N,3] RGB of the avatar itself, held in [kLeastColor, kLargestColor]
/// @param code        [1,P] pose_code
/// @param directions  [N,3] canonical_directions, or empty for a network without
/// @return            [N,3] RGB, 0 to 1
/// Adjoint: net, colors (none where one is beyond the range), code, directions. Throws InternalError when the shapes do
/// not fit.
template <class S>
Var<S> color_net(const ColorNetVars<S>& net, Var<S> colors, Var<S> code, Var<S> directions,
                 Source where = Source::current());

/// Adds the arrays `color_net/features`, `color_net/weightsL`, `color_net/biasL` (F32) and `color_net/code_joints`
/// (I32) of a network to a file.
void add_color_net(const ColorNet& net, SafetensorsWriter& file);

/// A file of a color net alone, format "hsi4d color net", in one step. Throws UserError when it cannot be written.
void write_color_net(const std::string& path, const ColorNet& net);

/// The network of a file, or nothing when it has none. Numbers come back as float32 has them.
/// @param rows    Gaussians
/// @param joints  of their skeleton
/// Throws DataError naming file and array: shapes that do not fit, a layer without outputs, more layers than
/// kMostMlpLayers or one missing in between, a joint that is not there, a number that is not finite.
std::optional<ColorNet> color_net_of(const Safetensors& file, Index rows, Index joints);

/// The network of a file of its own, as write_color_net and a run leave it. Throws UserError when the file cannot be
/// read; DataError as color_net_of, for another format, a newer version, or features of another count of Gaussians.
ColorNet read_color_net(const std::string& path, Index rows, Index joints);

}  // namespace hsi4d
