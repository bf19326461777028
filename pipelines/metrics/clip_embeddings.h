// CLIP score and CLIP consistency, from embeddings that another program has computed (docs/formats.md).
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/types.h"
#include "pipelines/metrics/metric_facts.h"

namespace hsi4d {

/// Embeddings of a video's frames and of its text, as they are in the file: of any length.
struct ClipEmbeddings {
  Index frames = 0, width = 0;  ///< T, D
  std::vector<double> images;   ///< [T,D]
  std::vector<double> text;     ///< [D]
  double frame_rate = 0;        ///< frames a second; 0: the file does not say
  std::string model, prompt;    ///< for people; may be empty
};

/// Reads embeddings (.npz): `image_embeddings` [T,D] and `text_embedding` [D] or [1,D], of any number type; and where
/// they are there `frame_rate`, the texts `model` and `prompt`.
///
/// Throws UserError when the file cannot be read; DataError naming file and array: missing, a shape that does not fit,
/// no frame, a number that is not finite, a row of zeros, a rate out of range.
ClipEmbeddings read_clip_embeddings(const std::string& path);
/// As read_clip_embeddings, of a file in memory. @param name  what messages call it
ClipEmbeddings decode_clip_embeddings(std::span<const std::uint8_t> file, const std::string& name);

/// What is adjacent for clip_consistency, seconds: frames of the method's clips, which have 10 a second.
inline constexpr double kAdjacentSeconds = 0.1;

/// With e_t = image_embeddings_t / |image_embeddings_t| and c the text's, likewise:
///
///   clip_score        100/T Σ_t e_t·c                                              [Hessel et al. 2021, without 2.5]
///   clip_consistency  100/(T−k) Σ_t e_t·e_{t+k}, k the frames in kAdjacentSeconds, rounded, at least 1; 1 where the
///                     file does not say its rate; only where there are more than k frames
MetricValues clip_metrics(const ClipEmbeddings& embeddings);

}  // namespace hsi4d
