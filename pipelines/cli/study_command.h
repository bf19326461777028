// `hsi4d study`: a page on which people choose between the videos of two methods, and what they chose.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace hsi4d::cli {

struct StudyOptions {
  std::vector<std::string> runs;      ///< A B
  std::string out;                    ///< --out DIR
  std::string texts;                  ///< --texts F.json
  std::optional<int> pairs;           ///< --pairs N, that a person is shown
  std::optional<std::uint64_t> seed;  ///< --seed N
  bool embed = false, quiet = false;  ///< --embed, --quiet
  std::vector<std::string> answers;   ///< --answers F.json...
  std::string key;                    ///< --key F.json
  std::string csv, json;              ///< --csv F, --json F; of answers
};

/// Makes the study of two runs, or of two folders of runs, and tells where page and key are; or, with answers, returns
/// a table of the share that prefers A by question, and writes the files of --csv and --json.
///
/// Throws UserError for options that do not go together; as make_study, read_study_key and read_study_answers.
std::string study_command(const StudyOptions& options);

}  // namespace hsi4d::cli
