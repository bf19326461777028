// The answers that people save at the end of a study's page.
//
//   {"format": "hsi4d study answers", "version": 1, "study": ID, "person": ..., "begun": ..., "finished": ...,
//    "answers": [{"pair": ID, "left": VIDEO, "right": VIDEO, "chosen": {"quality": VIDEO, "text": VIDEO},
//                 "seconds": ..., "plays": ...}]}
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "pipelines/study/key.h"

namespace hsi4d {

/// One choice.
struct StudyAnswer {
  std::size_t pair = 0;      ///< index into the key's pairs
  std::size_t question = 0;  ///< index into kStudyQuestions
  bool prefers_a = false;
  bool a_is_left = false;
  double seconds = 0;  ///< that the pair was looked at
  double plays = 0;    ///< how often its videos were played to their end

  bool prefers_left() const { return prefers_a == a_is_left; }
};

/// What one person chose.
struct StudyPerson {
  std::string person;
  std::string file;
  std::string begun;     ///< date and time as the page writes it, UTC; empty: not known
  std::string finished;  ///< likewise; empty: saved before the last pair
  std::vector<StudyAnswer> answers;
};

struct StudyAnswers {
  std::vector<StudyPerson> persons;  ///< by their ids
  std::vector<std::string> notes;    ///< files that do not count and why, persons who answered less than was asked
};

/// The files that `paths` stand for: files themselves, and of folders all that end in .json, whatever its case, by
/// name.
/// @param notes  receives a sentence for a folder that holds other files; null: none
/// Throws UserError for a folder without such files.
std::vector<std::string> study_answer_files(const std::vector<std::string>& paths, std::vector<std::string>* notes);

/// Reads answers to a study. What is the same file again counts once. Of several files of one person, those of the time
/// count that was begun first (of the times that came to an end, where one did), and of these the one that was finished
/// last: a person may go back and save again.
///
/// @param paths  as for study_answer_files
/// Throws UserError naming a file that cannot be read, or a folder without files; DataError naming file and position:
/// no answers, answers to another study, pairs, videos or questions that the study has not, a pair or question that is
/// answered twice, or a question left out.
StudyAnswers read_study_answers(const std::vector<std::string>& paths, const StudyKey& key);

}  // namespace hsi4d
