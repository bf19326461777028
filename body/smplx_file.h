// Files of SMPL-X, SMPL-H and SMPL body models (SMPLX_NEUTRAL.npz and the like), and bodies of other origin in the same
// layout.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "body/body_model.h"

namespace hsi4d {

/// Which directions are taken from a file.
struct SmplxFileOptions {
  Index betas = 10;
  Index expressions = 10;
  bool correctives = true;  ///< false: `posedirs` is left unread
};

/// The pose space of a hand.
struct SmplxHand {
  std::vector<double> mean;        ///< [45] axis-angle of its 15 joints, radians; empty: zeros
  std::vector<double> components;  ///< [n,45], the first explains most; empty: the file has none
  Index component_count() const { return static_cast<Index>(components.size()) / 45; }
};

/// A body model as its file has it. J = 55 joints in the order of smplx_joint_names.
struct SmplxModel {
  std::string source;                    ///< the file, for messages
  std::string name = kSmplxName;         ///< of the bodies that it makes
  std::vector<double> vertices;          ///< [V,3] metres, the template
  std::vector<std::int32_t> faces;       ///< [F,3]
  std::vector<int> parents;              ///< [J], −1 for the pelvis
  std::vector<double> shape;             ///< [3V,B] metres for each unit of a beta
  std::vector<double> expression;        ///< [3V,E]
  std::vector<double> joints;            ///< [J,3] metres, of the template
  std::vector<double> joint_shape;       ///< [3J,B] how joints follow the betas
  std::vector<double> joint_expression;  ///< [3J,E]
  std::vector<double> correctives;       ///< [3V,9(J−1)]; empty: the file has none
  DenseWeights weights;                  ///< [V,J]
  std::array<SmplxHand, 2> hands;        ///< left, right
  Index betas = 0, expressions = 0;      ///< B, E
  Index betas_in_file = 0;               ///< how many there are
  Index expressions_in_file = 0;
  Index rescaled_weights = 0;       ///< vertices whose weights summed up to 1 only within 1e-2: repaired
  std::vector<std::string> unread;  ///< arrays of Python objects, passed over without unpickling

  Index vertex_count() const { return static_cast<Index>(vertices.size() / 3); }
  Index joint_count() const { return static_cast<Index>(parents.size()); }
};

/// Reads a body model (.npz).
///
/// Read are `v_template` [V,3], `f` [F,3], `weights` [V,55], `kintree_table` [2,55] (its first row: parents; −1 or
/// 2³²−1 for the root), `shapedirs` [V,3,C], `J_regressor` [55,V], and where present `posedirs` [V,3,486], `J_template`
/// [55,3], `J_shapedirs` [55,3,D], `hands_meanl`, `hands_meanr` [45], `hands_componentsl`, `hands_componentsr` [n,45].
/// Of `shapedirs`, columns 0–299 are shape and 300 on expression where C ≥ 400 (SMPL-X 1.1), else 0–9 and 10–19 (1.0).
/// Joints are J_regressor times the shaped vertices. Where the file has `J_template` and `J_shapedirs` these say where
/// joints are, and columns of `shapedirs` that `J_shapedirs` has not (D < C) leave joints where they are.
///
/// SMPL-H (52 joints) and SMPL (24) have as many in place of 55, and 9 (J−1) columns of `posedirs`; all columns of
/// their `shapedirs` are shape. The model that comes of them has SMPL-X's 55 joints: those that the file has not move
/// nothing. Jaw and eyes are where the head is. Fingers of SMPL are where its hands are, whose weights go to the
/// wrists; what turning these hands corrects is left out.
///
/// Weights whose sum is 1 to the rounding of floats (kWeightRounding) stay as they are; within kWeightSumTolerance they
/// are divided by it and counted in `rescaled_weights`.
///
/// Throws UserError when the file cannot be read; DataError naming file and array: no such archive, an array missing or
/// of Python objects, a shape that does not fit, a number that is not finite or beyond 1e6, parents that are no tree or
/// not that of SMPL, a face's vertex out of range, weights as in normalized_weights, more betas or expressions asked
/// for than there are.
SmplxModel read_smplx(const std::string& path, const SmplxFileOptions& options = {});
/// As read_smplx, of a file in memory. @param name  what messages call it
SmplxModel decode_smplx(std::span<const std::uint8_t> file, const std::string& name,
                        const SmplxFileOptions& options = {});

/// The body in its rest pose and shape β: template, joints, and the four largest weights of each vertex.
/// @param betas  as many as there are in the model, or none: the template
/// Throws DataError naming file and array when the faces have no area: there is nothing to put Gaussians on, or to see.
/// InternalError when there are another number of betas.
BodyModel rest_body(const SmplxModel& model, std::span<const double> betas = {});

}  // namespace hsi4d
