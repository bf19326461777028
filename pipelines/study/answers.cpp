#include "pipelines/study/answers.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <set>
#include <tuple>
#include <utility>

#include "core/check.h"
#include "core/config_value.h"
#include "core/file.h"
#include "core/json_text.h"
#include "core/text.h"
#include "pipelines/study/json.h"

namespace hsi4d {

namespace {

namespace fs = std::filesystem;
using Kind = ConfigValue::Kind;

bool is_json(const fs::path& file) {
  std::string ending = file.extension().string();
  for (char& c : ending) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  return ending == ".json";
}

/// The files in a folder, by name: those that are read, and the names of others.
std::pair<std::vector<std::string>, std::vector<std::string>> files_in(const std::string& folder) {
  std::vector<std::string> files, others;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    if (entry.is_directory()) continue;
    if (is_json(entry.path()))
      files.push_back(entry.path().string());
    else
      others.push_back(entry.path().filename().string());
  }
  std::sort(files.begin(), files.end());
  std::sort(others.begin(), others.end());
  return {files, others};
}

const ConfigValue& needed_string(const ConfigValue& object, std::string_view name, const std::string& pointer) {
  const ConfigValue& value = needed(object, name, pointer);
  check_kind(value, Kind::kString, child_pointer(pointer, name));
  return value;
}

/// What a person chose of one pair.
class AnswerReader {
 public:
  AnswerReader(const ConfigValue& entry, std::string pointer, const StudyKey& key)
      : entry_(entry), pointer_(std::move(pointer)), key_(key) {}

  std::vector<StudyAnswer> read() {
    check_kind(entry_, Kind::kObject, pointer_);
    StudyAnswer answer;
    answer.pair = find_pair();
    const StudyPair& pair = key_.pairs[answer.pair];
    answer.a_is_left = video("left", pair) == pair.a;
    if ((video("right", pair) == pair.a) == answer.a_is_left) fail("right", "is the video that is left, too");
    answer.seconds = number_of(needed(entry_, "seconds", pointer_), at("seconds"));
    answer.plays = number_of(needed(entry_, "plays", pointer_), at("plays"));
    return choices(answer, pair);
  }

 private:
  std::string at(std::string_view name) const { return child_pointer(pointer_, name); }

  [[noreturn]] void fail(std::string_view name, const std::string& message) const {
    const ConfigValue& value = *find_member(entry_, name);
    fail_at(value, at(name), shown(value) + " " + message);
  }

  std::size_t find_pair() const {
    const std::string& id = needed_string(entry_, "pair", pointer_).text;
    const auto found =
        std::find_if(key_.pairs.begin(), key_.pairs.end(), [&id](const StudyPair& pair) { return pair.id == id; });
    if (found == key_.pairs.end()) fail("pair", "is no pair of this study");
    return static_cast<std::size_t>(found - key_.pairs.begin());
  }

  std::string video(std::string_view name, const StudyPair& pair) const {
    const std::string& id = needed_string(entry_, name, pointer_).text;
    if (id != pair.a && id != pair.b) fail(name, "is no video of this pair");
    return id;
  }

  std::vector<StudyAnswer> choices(StudyAnswer answer, const StudyPair& pair) const {
    const ConfigValue& chosen = needed(entry_, "chosen", pointer_);
    check_kind(chosen, Kind::kObject, at("chosen"));
    std::vector<StudyAnswer> answers;
    for (std::size_t q = 0; q < kStudyQuestions.size(); ++q) {
      if (!pair.asks(kStudyQuestions[q])) continue;
      const ConfigValue& choice = needed_string(chosen, kStudyQuestions[q].id, at("chosen"));
      if (choice.text != pair.a && choice.text != pair.b)
        fail_at(choice, child_pointer(at("chosen"), kStudyQuestions[q].id),
                json_string(choice.text) + " is no video of this pair");
      answer.question = q;
      answer.prefers_a = choice.text == pair.a;
      answers.push_back(answer);
    }
    for (const ConfigMember& member : chosen.members) {
      const bool is_asked =
          std::any_of(kStudyQuestions.begin(), kStudyQuestions.end(),
                      [&](const StudyQuestion& asked) { return asked.id == member.key && pair.asks(asked); });
      if (!is_asked) fail_at(member.value, child_pointer(at("chosen"), member.key), "this was not asked of the pair");
    }
    return answers;
  }

  const ConfigValue& entry_;
  std::string pointer_;
  const StudyKey& key_;
};

StudyPerson read_person(const std::string& file, const StudyKey& key) {
  const ConfigValue root = read_study_file(file, "hsi4d study answers");
  const ConfigValue& study = needed_string(root, "study", "");
  if (study.text != key.study)
    fail_at(study, "/study",
            "answers to another study, " + json_string(study.text) + "; the key is of " + json_string(key.study));
  StudyPerson person{
      needed_text(root, "person", ""), file, needed_text(root, "begun", ""), needed_text(root, "finished", ""), {}};
  if (person.person.empty()) fail_at(*find_member(root, "person"), "/person", "is empty");
  std::set<std::size_t> pairs;
  const ConfigValue& answers = needed_array(root, "answers", "");
  for (std::size_t i = 0; i < answers.items.size(); ++i) {
    const std::string pointer = child_pointer("/answers", std::to_string(i));
    const std::vector<StudyAnswer> of_pair = AnswerReader(answers.items[i], pointer, key).read();
    if (!pairs.insert(of_pair.front().pair).second)
      fail_at(answers.items[i], pointer, "the pair is answered a second time");
    person.answers.insert(person.answers.end(), of_pair.begin(), of_pair.end());
  }
  return person;
}

std::size_t pairs_answered(const StudyPerson& person) {
  std::set<std::size_t> pairs;
  for (const StudyAnswer& answer : person.answers) pairs.insert(answer.pair);
  return pairs.size();
}

/// Whether `x` counts and not `y`, of the same person. An order of all files: which is read first does not matter.
bool counts_before(const StudyPerson& x, const StudyPerson& y) {
  const auto rank = [](const StudyPerson& person) {
    return std::tuple(person.finished.empty(), person.begun.empty(), person.begun);
  };
  if (rank(x) != rank(y)) return rank(x) < rank(y);
  if (x.finished != y.finished) return x.finished > y.finished;
  if (x.answers.size() != y.answers.size()) return x.answers.size() > y.answers.size();
  return x.file < y.file;
}

/// Why `other` counts alone of the two.
std::string why_counts(const StudyPerson& other, const StudyPerson& person) {
  if (person.begun == other.begun && person.finished != other.finished) return "was finished later";
  if (person.begun == other.begun) return "has as many answers or more";
  return person.finished.empty() && !other.finished.empty() ? "was finished" : "was begun first";
}

void tell_unfinished(const StudyKey& key, StudyAnswers& answers) {
  const Index shown = key.shown_pairs();
  for (const StudyPerson& person : answers.persons) {
    const auto answered = static_cast<Index>(pairs_answered(person));
    if (answered != shown)
      answers.notes.push_back(person.file + ": answers " + std::to_string(answered) + " of the " +
                              std::to_string(shown) + " pairs that a person is shown; these count");
  }
}

}  // namespace

std::vector<std::string> study_answer_files(const std::vector<std::string>& paths, std::vector<std::string>* notes) {
  std::vector<std::string> files;
  for (const std::string& path : paths) {
    if (!fs::is_directory(path)) {
      files.push_back(path);
      continue;
    }
    const auto [found, others] = files_in(path);
    if (found.empty()) throw UserError(path + ": the folder holds no .json file");
    if (notes != nullptr && !others.empty())
      notes->push_back(path + ": holds other files, which are not read: " + joined(others));
    files.insert(files.end(), found.begin(), found.end());
  }
  return files;
}

StudyAnswers read_study_answers(const std::vector<std::string>& paths, const StudyKey& key) {
  StudyAnswers answers;
  std::map<std::string, std::string> contents;  // file by content
  std::map<std::string, StudyPerson> by_person;
  for (const std::string& file : study_answer_files(paths, &answers.notes)) {
    const auto [same, is_new] = contents.try_emplace(read_text_file(file), file);
    if (!is_new) {
      answers.notes.push_back(file + ": is the same as " + same->second + " and counts once");
      continue;
    }
    StudyPerson person = read_person(file, key);
    const auto [known, is_first] = by_person.try_emplace(person.person, person);
    if (is_first) continue;
    if (counts_before(person, known->second)) std::swap(person, known->second);
    answers.notes.push_back(person.file + ": is of the same person as " + known->second.file + ", which " +
                            why_counts(known->second, person) + " and counts alone");
  }
  for (auto& [id, person] : by_person) answers.persons.push_back(std::move(person));
  tell_unfinished(key, answers);
  return answers;
}

}  // namespace hsi4d
