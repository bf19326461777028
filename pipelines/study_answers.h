// The answers that people save at the end of a study's page.
//
//   {"format": "hsi4d study answers", "version": 1, "study": ID, "person": ..., "begun": ..., "finished": ...,
//    "answers": [{"pair": ID, "left": VIDEO, "right": VIDEO, "chosen": {"quality": VIDEO, "text": VIDEO},
//                 "seconds": ..., "plays": ...}]}
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "pipelines/study_key.h"

namespace hsi4d {

/// One choice.
struct StudyAnswer {
  std::size_t pair = 0;      ///< index into the key's pairs
  std::size_t question = 0;  ///< index into kStudyQuestions
  bool prefers_a = false;
  bool a_is_left = false;
  double seconds = 0;  ///< that the pair was looked at

  bool prefers_left() const { return prefers_a == a_is_left; }
};

/// What one person chose.
struct StudyPerson {
  std::string person;
  std::string file;
  std::string finished;  ///< date and time as the page writes it, UTC; empty: not known
  std::vector<StudyAnswer> answers;
};

struct StudyAnswers {
  std::vector<StudyPerson> persons;  ///< in the order of their files
  std::vector<std::string> notes;    ///< files that do not count and why, persons who answered less than was asked
};

/// Reads answers to a study. What is the same file again counts once; of several files of one person the one that was
/// finished first counts.
///
/// @param files  JSON files, or folders of which all .json files are read
/// Throws UserError naming a file that cannot be read, or a folder without files; DataError naming file and position:
/// no answers, answers to another study, pairs, videos or questions that the study has not, a pair or question that is
/// answered twice, or a question left out.
StudyAnswers read_study_answers(const std::vector<std::string>& files, const StudyKey& key);

}  // namespace hsi4d
