#include "body/smplx_sequence.h"

#include <algorithm>
#include <cmath>

#include "body/file_contents.h"
#include "body/pose_layout.h"
#include "core/npz.h"
#include "core/suggest.h"
#include "core/text.h"

namespace hsi4d {

namespace {

struct SequenceField {
  const char* name;
  SmplxTrack SmplxSequence::*track;
  Index joints;      // of a rotation; 0: no rotation
  Index width;       // 0: from 1 to most
  Index most_width;  // of those
};

constexpr Index kMostExpressions = 100;  // of SMPL-X 1.1

constexpr SequenceField kFields[] = {
    {"betas", &SmplxSequence::betas, 0, 0, kMostBetas},
    {"expression", &SmplxSequence::expression, 0, 0, kMostExpressions},
    {"global_orient", &SmplxSequence::global_orient, 1, 3, 3},
    {"body_pose", &SmplxSequence::body_pose, 21, 63, 63},
    {"jaw_pose", &SmplxSequence::jaw_pose, 1, 3, 3},
    {"leye_pose", &SmplxSequence::leye_pose, 1, 3, 3},
    {"reye_pose", &SmplxSequence::reye_pose, 1, 3, 3},
    {"left_hand_pose", &SmplxSequence::left_hand_pose, kHandJoints, 0, kHandNumbers},
    {"right_hand_pose", &SmplxSequence::right_hand_pose, kHandJoints, 0, kHandNumbers},
    {"transl", &SmplxSequence::transl, 0, 3, 3},
};

/// What goes along with parameters in files of others and says nothing about the pose.
constexpr const char* kNotes[] = {"gender",           "model_type",      "surface_model_type",
                                  "mocap_frame_rate", "mocap_framerate", "mocap_time_length",
                                  "first_frame",      "frame_rate",      "fps"};

std::string allowed_shapes(const SequenceField& field) {
  std::string text;
  if (field.width > 0) {
    const std::string width = std::to_string(field.width);
    text = "[" + width + "], [T," + width + "]";
  } else {
    text = "[n], [T,n] with n of 1 to " + std::to_string(field.most_width);
  }
  const std::string joints = std::to_string(field.joints);
  if (field.joints > 1) text += ", [" + joints + ",3]";
  if (field.joints > 0) text += ", [T," + joints + ",3]";
  return text;
}

/// Whether the array is one row for all frames, or T rows; sets width and rows.
///
/// @param other_frames  what other parameters have: [15,3] is a hand, if not 15 frames of 3 coefficients
bool shape_fits(const SequenceField& field, const std::vector<std::int64_t>& shape, Index other_frames,
                SmplxTrack& track) {
  const bool is_table = shape.size() == 2 && field.joints > 1 && shape[0] == field.joints && shape[1] == 3;
  if (is_table && !(field.width == 0 && other_frames == field.joints)) {
    track.rows = 1;
    track.width = 3 * field.joints;
    return true;
  }
  if (shape.size() == 3) {
    track.rows = shape[0];
    track.width = 3 * field.joints;
    return field.joints > 0 && shape[1] == field.joints && shape[2] == 3;
  }
  if (shape.empty() || shape.size() > 2) return false;
  track.rows = shape.size() == 1 ? 1 : shape[0];
  track.width = shape.back();
  return field.width > 0 ? track.width == field.width : track.width >= 1 && track.width <= field.most_width;
}

SmplxTrack read_track(const SequenceField& field, const NpyArray& array, Index other_frames) {
  SmplxTrack track;
  if (!shape_fits(field, array.shape(), other_frames, track)) {
    throw DataError(array.source() + ": has shape " + shape_text(array.shape()) +
                    "; allowed: " + allowed_shapes(field));
  }
  if (track.rows == 0) throw DataError(array.source() + ": holds no frame");
  track.numbers = array.as<double>();
  const bool are_betas = field.track == &SmplxSequence::betas;
  for (std::size_t i = 0; i < track.numbers.size(); ++i) {
    if (std::abs(track.numbers[i]) <= (are_betas ? kLargestBeta : kLargestBodyNumber)) continue;
    const auto width = static_cast<std::size_t>(track.width);
    throw DataError(array.source() + ": frame " + std::to_string(i / width) + ", number " + std::to_string(i % width) +
                    " is " + number_text(track.numbers[i]) +
                    "; allowed: " + (are_betas ? kBetasText : kBodyNumbersText));
  }
  return track;
}

/// Arrays that are no parameter; one that is nearly called as one that is missing is refused.
std::vector<std::string> other_arrays(const Npz& file) {
  std::vector<std::string> known, names = file.names(), others;
  for (const SequenceField& field : kFields) known.emplace_back(field.name);
  for (const Npz::Skipped& skipped : file.skipped()) names.push_back(skipped.name);
  for (const std::string& name : names) {
    const bool is_note = std::find(std::begin(kNotes), std::end(kNotes), name) != std::end(kNotes);
    if (is_note || std::find(known.begin(), known.end(), name) != known.end()) continue;
    if (const std::string meant = nearest_name(name, known); !meant.empty() && !file.has(meant)) {
      throw DataError(file.source() + ": there is no parameter \"" + name + "\"; known: " + joined(known) +
                      did_you_mean(name, known));
    }
    others.push_back(name);
  }
  return others;
}

/// The frames that all tracks agree on.
Index common_frames(const SmplxSequence& sequence) {
  Index frames = 1;
  const char* decided_by = nullptr;
  for (const SequenceField& field : kFields) {
    const SmplxTrack& track = sequence.*field.track;
    if (!track.is_given() || track.rows == 1) continue;
    if (decided_by != nullptr && track.rows != frames) {
      throw DataError(sequence.source + ": array '" + field.name + "': has " + std::to_string(track.rows) +
                      " frames; '" + decided_by + "' has " + std::to_string(frames) + "; allowed: the same, or 1");
    }
    if (decided_by == nullptr) decided_by = field.name;
    frames = track.rows;
  }
  return frames;
}

/// Reads the hands, or all others, that are there. An array of Python objects under such a name throws, saying why.
bool read_tracks(const Npz& file, bool of_hands, SmplxSequence& sequence) {
  bool is_any = false;
  const Index other_frames = of_hands ? common_frames(sequence) : 0;
  for (const SequenceField& field : kFields) {
    const bool is_skipped = std::any_of(file.skipped().begin(), file.skipped().end(),
                                        [&](const Npz::Skipped& s) { return s.name == field.name; });
    if ((field.joints == kHandJoints) != of_hands || (!file.has(field.name) && !is_skipped)) continue;
    sequence.*field.track = read_track(field, file.array(field.name), other_frames);
    is_any = true;
  }
  return is_any;
}

SmplxSequence sequence_of(const Npz& file) {
  SmplxSequence sequence;
  sequence.source = file.source();
  if (contents_of(file) == "a motion") {
    throw DataError(file.source() +
                    ": holds a motion by the names of AMASS, not parameters by those of smplx; `hsi4d "
                    "motion` reads it, and with --body-model shows the body (.glb)");
  }
  refuse_other_contents(file, {"parameters of smplx"});
  sequence.passed_over = other_arrays(file);
  const bool is_body = read_tracks(file, false, sequence), is_hand = read_tracks(file, true, sequence);
  if (!is_body && !is_hand) {
    std::vector<std::string> known;
    for (const SequenceField& field : kFields) known.emplace_back(field.name);
    throw DataError(file.source() + ": holds none of the parameters " + joined(known));
  }
  sequence.frames = common_frames(sequence);
  return sequence;
}

bool is_pca(const SmplxTrack& hand, SmplxHands hands) {
  return hands == SmplxHands::kPca || (hands == SmplxHands::kByWidth && hand.width != kHandNumbers);
}

void check_hand(const SmplxModel& model, const SmplxSequence& sequence, const SequenceField& field, SmplxHands hands) {
  const SmplxTrack& hand = sequence.*field.track;
  if (!hand.is_given()) return;
  const std::string start = sequence.source + ": array '" + field.name + "': has " + std::to_string(hand.width);
  if (!is_pca(hand, hands)) {
    if (hand.width != kHandNumbers) throw DataError(start + " numbers a frame; of a full hand 45 are needed");
    return;
  }
  const std::size_t side = field.track == &SmplxSequence::left_hand_pose ? 0 : 1;
  const Index there = model.hands[side].component_count();
  if (hand.width > there) {
    throw DataError(start + " coefficients a frame; " + model.source + " has " + std::to_string(there) +
                    " components of that hand");
  }
}

/// A track and the leaf that it is written to.
template <class S>
struct Leaf {
  const SmplxTrack* track;
  Var<S> var;
};

}  // namespace

SmplxTrack first_numbers(const SmplxTrack& track, Index width) {
  if (track.width <= width) return track;
  SmplxTrack first;
  if (width == 0) return first;
  first.width = width;
  first.rows = track.rows;
  for (Index row = 0; row < track.rows; ++row) {
    const auto begin = track.numbers.begin() + row * track.width;
    first.numbers.insert(first.numbers.end(), begin, begin + width);
  }
  return first;
}

SmplxSequence read_smplx_sequence(const std::string& path) { return sequence_of(Npz::read(path)); }

SmplxSequence decode_smplx_sequence(std::span<const std::uint8_t> file, const std::string& name) {
  return sequence_of(Npz::decode(file, name));
}

template <class S>
SmplxFrames<S> pose_frames(const SmplxModel& model, const SmplxSequence& sequence, SmplxHands hands,
                           bool flat_hand_mean) {
  HSI4D_CHECK_EQ(model.betas, sequence.betas.width);
  HSI4D_CHECK_EQ(model.expressions, sequence.expression.width);
  SmplxBodyOptions options;
  options.flat_hand_mean = flat_hand_mean;
  const SmplxBody<S> body(model, options);
  Tape<S> tape;
  SmplxParameters<S> p;
  std::vector<Leaf<S>> leaves;
  const auto add = [&](const char* name, Var<S>& var, const SmplxTrack& track, Index rows) {
    if (!track.is_given()) return;
    var = tape.constant(name, shape_of(rows, track.width / rows));
    leaves.push_back({&track, var});
  };
  for (const SequenceField& field : kFields) {
    if (field.joints == kHandJoints) check_hand(model, sequence, field, hands);
  }
  const auto hand_rows = [&](const SmplxTrack& hand) { return is_pca(hand, hands) ? 1 : kHandJoints; };
  add("betas", p.betas, sequence.betas, 1);
  add("expression", p.expression, sequence.expression, 1);
  add("global_orient", p.global_orient, sequence.global_orient, 1);
  add("body_pose", p.body_pose, sequence.body_pose, 21);
  add("jaw_pose", p.jaw_pose, sequence.jaw_pose, 1);
  add("leye_pose", p.leye_pose, sequence.leye_pose, 1);
  add("reye_pose", p.reye_pose, sequence.reye_pose, 1);
  add("left_hand_pose", p.left_hand_pose, sequence.left_hand_pose, hand_rows(sequence.left_hand_pose));
  add("right_hand_pose", p.right_hand_pose, sequence.right_hand_pose, hand_rows(sequence.right_hand_pose));
  add("transl", p.transl, sequence.transl, 1);
  const PosedSmplx<S> posed = pose_smplx(tape, body, p);

  SmplxFrames<S> frames;
  std::vector<S> numbers;
  for (Index t = 0; t < sequence.frames; ++t) {
    for (const Leaf<S>& leaf : leaves) {
      if (t > 0 && leaf.track->rows == 1) continue;
      const std::span<const double> row = leaf.track->at(t);
      numbers.assign(row.begin(), row.end());
      tape.set(leaf.var, numbers);
    }
    for (auto [result, to] : {std::pair{posed.vertices, &frames.vertices}, std::pair{posed.joints, &frames.joints}}) {
      tape.forward(result);
      const ConstArray<S> value = tape.value(result);
      to->insert(to->end(), value.data, value.data + value.shape.count());
    }
  }
  return frames;
}

#define HSI4D_INSTANTIATE(S) \
  template SmplxFrames<S> pose_frames(const SmplxModel&, const SmplxSequence&, SmplxHands, bool);
HSI4D_INSTANTIATE(float)
HSI4D_INSTANTIATE(double)
#undef HSI4D_INSTANTIATE

}  // namespace hsi4d
