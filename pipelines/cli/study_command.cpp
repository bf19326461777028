// `hsi4d study`: a page on which people choose between the videos of two methods, and what they chose.
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "core/check.h"
#include "core/file.h"
#include "core/progress.h"
#include "pipelines/cli/interrupt.h"
#include "pipelines/cli/list.h"
#include "pipelines/cli/options.h"
#include "pipelines/cli/scene_options.h"
#include "pipelines/cli/terminal.h"
#include "pipelines/cli/text.h"
#include "pipelines/record/summary.h"
#include "pipelines/study/key.h"
#include "pipelines/study/results.h"
#include "pipelines/study/study.h"

namespace hsi4d::cli {

namespace {

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
  std::string collect, completion;    ///< --collect URL, --completion CODE
};

namespace fs = std::filesystem;

const std::string kStudyCommand = "hsi4d study: ";

/// Throws where an option that belongs to the other of the two uses is given.
void check_absent(const std::vector<std::pair<std::string, bool>>& options, const std::string& without) {
  for (const auto& [name, is_given] : options) {
    if (is_given) throw UserError(kStudyCommand + name + " " + without);
  }
}

std::string notes_text(const std::vector<std::string>& notes) {
  std::string text;
  for (const std::string& note : notes) text += "note: " + note + "\n";
  return text;
}

std::string make_page(const StudyOptions& o) {
  check_absent({{"--key", !o.key.empty()}, {"--csv", !o.csv.empty()}, {"--json", !o.json.empty()}}, "is for --answers");
  if (o.runs.size() != 2)
    throw UserError(kStudyCommand + "compares two runs, or two folders of runs: A and B (" +
                    std::to_string(o.runs.size()) + " given); --answers tells what people chose");
  if (o.out.empty()) throw UserError(kStudyCommand + "--out says where the page goes: a new or empty folder");
  const InterruptWatch watch;
  const Study study = make_study({o.runs[0],
                                  o.runs[1],
                                  o.out,
                                  o.texts,
                                  o.pairs.value_or(kPairsPerPerson),
                                  o.seed,
                                  o.embed,
                                  {o.collect, o.completion}},
                                 observer_on_terminal(o.quiet));
  return study.page.generic_string() + ": " + count_text(std::ssize(study.key.pairs), "pair") +
         ", of which a person is shown " + std::to_string(study.key.shown_pairs()) +
         (o.embed ? "; one file" : "; goes with videos/") + "\n" + study.key_file.generic_string() +
         ": the key, which tells A from B: keep it, do not hand it out\n" + notes_text(study.notes);
}

std::string percent_text(double share) { return fixed_number(100 * share, 1); }

std::string interval_text(const ShareInterval& interval) {
  return percent_text(interval.low) + " to " + percent_text(interval.high);
}

std::string shares_table(const std::vector<StudyShare>& shares) {
  Table table{.head = {"question", "persons", "answers", "prefer A [%]", "95 % of answers", "95 % over persons",
                       "Student's t", "chose left [%]"}};
  for (const StudyShare& share : shares) {
    table.rows.push_back(
        {kStudyQuestions[share.question].id, share.persons, share.all.answers, percent_text(share.all.share()),
         interval_text(share.wilson), share.bootstrap ? interval_text(*share.bootstrap) : "-",
         share.student ? interval_text(*share.student) : "-",
         percent_text(static_cast<double>(share.prefer_left) / static_cast<double>(share.all.answers))});
  }
  return table_text(table);
}

/// The files that are written are none of those that are read, nor the same.
void check_study_outputs(const StudyOptions& o) {
  std::vector<std::string> inputs = study_answer_files(o.answers, nullptr);
  inputs.push_back(o.key);
  for (const auto& [name, file] : {std::pair{"--csv", o.csv}, {"--json", o.json}}) {
    if (file.empty()) continue;
    check_no_input(file, kStudyCommand + name, inputs);
    check_writable(file);
  }
  const auto place = [](const std::string& file) { return fs::weakly_canonical(fs::absolute(file)); };
  if (!o.csv.empty() && !o.json.empty() && place(o.csv) == place(o.json))
    throw UserError(kStudyCommand + "--csv and --json are the same file, " + o.json);
}

std::string tell_results(const StudyOptions& o) {
  check_absent({{"--out", !o.out.empty()},
                {"--texts", !o.texts.empty()},
                {"--embed", o.embed},
                {"--collect", !o.collect.empty()},
                {"--completion", !o.completion.empty()},
                {"--pairs", o.pairs.has_value()},
                {"--seed", o.seed.has_value()}},
               "is for making a study, not for --answers");
  if (!o.runs.empty())
    throw UserError(kStudyCommand + "--answers are read without A and B, which the key knows; found " + o.runs.front());
  if (o.key.empty())
    throw UserError(kStudyCommand +
                    "--key says which video is whose: the file that was made beside the study's folder, "
                    "DIR-key.json");
  check_study_outputs(o);
  const StudyKey key = read_study_key(o.key);
  const StudyAnswers answers = read_study_answers(o.answers, key);
  const std::vector<StudyShare> shares = study_shares(answers);
  if (shares.empty()) throw UserError(kStudyCommand + "the files hold no answer");
  if (!o.csv.empty()) write_text_file(o.csv, study_answers_csv(key, answers));
  if (!o.json.empty()) write_text_file(o.json, study_results_json(key, answers, shares));
  return shares_table(shares) + "\nA: " + key.a + "\nB: " + key.b + "\n" +
         count_text(std::ssize(answers.persons), "person") + ", " + count_text(std::ssize(key.pairs), "pair") + "\n" +
         notes_text(study_cautions(shares)) + notes_text(answers.notes);
}

/// Makes the study of two runs, or of two folders of runs, and tells where page and key are; or, with answers, returns
/// a table of the share that prefers A by question, and writes the files of --csv and --json.
///
/// Throws UserError for options that do not go together; as make_study, read_study_key and read_study_answers.
std::string study_command(const StudyOptions& options) {
  return options.answers.empty() ? make_page(options) : tell_results(options);
}

}  // namespace

void add_study(CLI::App& app, Program& program) {
  StudyOptions& o = program.options<StudyOptions>();
  CLI::App* command =
      app.add_subcommand("study", "Make a page on which people choose between videos, or tell what they chose");
  command
      ->add_option("RUNS", o.runs,
                   "A and B: two runs, two folders of runs with the same names, or runs of sweeps: SWEEP/NAME, as "
                   "runs/ablations/whole")
      ->expected(0, 2)
      ->option_text("A B");
  command->add_option("--out", o.out, "Where the page goes: a new or empty folder; the key goes beside it")
      ->type_name("DIR");
  command
      ->add_option("--texts", o.texts,
                   "What happens in the videos, {\"NAME\": \"text\"}; default: sources.prompt of the runs' configs")
      ->type_name("F.json");
  command->add_option("--pairs", o.pairs, "Pairs that a person is shown; default: " + std::to_string(kPairsPerPerson))
      ->check(CLI::Range(1, 1000))
      ->type_name("N");
  command->add_option("--seed", o.seed, "Names of videos and pairs follow from it; default: they are random")
      ->check(whole_number())
      ->type_name("N");
  command->add_flag("--embed", o.embed, "One file: the videos are in the page");
  command
      ->add_option("--collect", o.collect,
                   "Where the page sends answers (HTTP POST); default: nowhere, people save them as a file")
      ->type_name("URL");
  command
      ->add_option(
          "--completion", o.completion,
          "Shown to who has answered all and sent (or saved) it: a code, or an address to go to, as Prolific's")
      ->type_name("CODE");
  command->add_flag("--quiet", o.quiet, "No progress on stderr");
  command->add_option("--answers", o.answers, "Files that people saved, or folders of them; A and B are then left out")
      ->type_name("F.json");
  command->add_option("--key", o.key, "Of answers: the study's key")->type_name("F.json");
  command->add_option("--csv", o.csv, "Of answers: file for them, a line each")->type_name("F");
  command->add_option("--json", o.json, "Of answers: file for all numbers")->type_name("F");
  run_when_chosen(*command, program, [&] { return study_command(o); });
}

}  // namespace hsi4d::cli
