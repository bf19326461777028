// What a forced-choice study compares, and which of its videos is whose: the key that the page does not have.
//
//   KEY.json   {"format": "hsi4d study key", "version": 1, "study": ID, "a": "runs/best", "b": "runs/other",
//               "salt": HEX, "pairs_per_person": 10, "pairs": [{"id": ..., "name": ..., "text": ..., "a": VIDEO, "b":
//               VIDEO}]}
//
// A person is shown some of the pairs, each with its two videos left and right by chance, and chooses one of them by
// each question.  [method.md, §7]
#pragma once

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "core/types.h"

namespace hsi4d {

/// What is asked of each pair.
struct StudyQuestion {
  std::string_view id;
  std::string_view words;
  bool needs_text;  ///< asked only of pairs that have a text
};

inline constexpr std::array<StudyQuestion, 2> kStudyQuestions = {
    {{"quality", "Which video is of higher quality?", false},
     {"text", "Which video agrees better with the text?", true}}};

/// Two videos of the same task.
struct StudyPair {
  std::string id;    ///< in the page and in answers
  std::string name;  ///< of the runs; "pair" where A and B are one run each
  std::string text;  ///< what was to happen; empty: unknown
  std::string a, b;  ///< videos, by the names that they have in the page: videos/NAME.mp4

  bool asks(const StudyQuestion& question) const { return !question.needs_text || !text.empty(); }
};

/// Pairs that a person is shown unless another number is asked for.  [method.md, §7]
inline constexpr Index kPairsPerPerson = 10;

struct StudyKey {
  std::string study;  ///< hash of everything else
  std::string a, b;   ///< where the videos come from
  std::string salt;   ///< random digits, so that `study`, which the page has, tells nothing of the rest; empty: none
  Index pairs_per_person = kPairsPerPerson;
  std::vector<StudyPair> pairs;

  /// The pairs that one person is shown.
  Index shown_pairs() const;
};

/// Hash of what a study compares, without `study` itself.
std::string study_id(const StudyKey& key);

/// The key's file.
std::string study_key_json(const StudyKey& key);

/// Reads a key. Throws UserError naming a file that cannot be read, DataError naming the position of what is wrong: no
/// key, a newer version, members missing or doubled, an id that is not the content's.
StudyKey read_study_key(const std::string& file);

}  // namespace hsi4d
