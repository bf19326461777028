#include "pipelines/study/results.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include "core/check.h"
#include "core/config_value.h"
#include "core/random.h"
#include "core/table.h"
#include "core/text.h"

namespace hsi4d {

namespace {

constexpr double kNormalQuantile = 1.959963984540054;  // of (1 + kStudyConfidence) / 2
constexpr std::uint64_t kStream = random_stream("study.bootstrap");

/// Between the two values that are nearest to a share of the sorted ones.
double quantile(const std::vector<double>& sorted, double share) {
  const double place = share * static_cast<double>(sorted.size() - 1);
  const auto below = static_cast<std::size_t>(place);
  const std::size_t above = std::min(below + 1, sorted.size() - 1);
  return sorted[below] + (place - static_cast<double>(below)) * (sorted[above] - sorted[below]);
}

void add(StudyCount& count, bool prefers_a) {
  ++count.answers;
  count.prefer_a += prefers_a ? 1 : 0;
}

/// The persons by their ids: chance then meets the same ones, in whatever order files are given.
std::vector<const StudyPerson*> by_id(const StudyAnswers& answers) {
  std::vector<const StudyPerson*> persons;
  for (const StudyPerson& person : answers.persons) persons.push_back(&person);
  std::sort(persons.begin(), persons.end(), [](const auto* x, const auto* y) { return x->person < y->person; });
  return persons;
}

/// The probability of |t| < tan(angle) √freedom.
double student_share(double angle, Index freedom) {
  const bool is_odd = freedom % 2 == 1;
  const double cosine = std::cos(angle), sine = std::sin(angle);
  double term = is_odd ? cosine : 1, sum = 0;
  for (Index k = is_odd ? 1 : 0; k + 2 <= freedom; k += 2) {
    sum += term;
    term *= cosine * cosine * static_cast<double>(k + 1) / static_cast<double>(k + 2);
  }
  return is_odd ? 2 / std::numbers::pi * (angle + sine * sum) : sine * sum;
}

StudyShare share_of(std::size_t question, const StudyAnswers& answers) {
  StudyShare share;
  share.question = question;
  std::map<std::size_t, StudyCount> by_pair;
  std::vector<StudyCount> persons;
  for (const StudyPerson* const person : by_id(answers)) {
    StudyCount own;
    for (const StudyAnswer& answer : person->answers) {
      if (answer.question != question) continue;
      add(own, answer.prefers_a);
      add(by_pair[answer.pair], answer.prefers_a);
      share.prefer_left += answer.prefers_left() ? 1 : 0;
    }
    if (own.answers == 0) continue;
    persons.push_back(own);
    share.all.answers += own.answers;
    share.all.prefer_a += own.prefer_a;
  }
  share.persons = std::ssize(persons);
  share.by_pair.assign(by_pair.begin(), by_pair.end());
  if (share.all.answers > 0) share.wilson = wilson_interval(share.all);
  if (persons.size() > 1) {
    share.bootstrap = person_bootstrap(persons);
    share.student = person_student(persons);
  }
  return share;
}

// ---- JSON and CSV ----

ConfigValue interval_json(const ShareInterval& interval) {
  return ConfigValue::make_array({ConfigValue::make_number(interval.low), ConfigValue::make_number(interval.high)});
}

void add_count(ConfigValue& object, const StudyCount& count) {
  object.add("answers", ConfigValue::make_integer(count.answers));
  object.add("prefer_a", ConfigValue::make_integer(count.prefer_a));
  object.add("share_a", ConfigValue::make_number(count.share()));
  object.add("wilson", interval_json(wilson_interval(count)));
}

ConfigValue share_json(const StudyKey& key, const StudyShare& share) {
  const StudyQuestion& question = kStudyQuestions[share.question];
  ConfigValue object = ConfigValue::make_object(), pairs = ConfigValue::make_array();
  object.add("id", ConfigValue::make_string(question.id));
  object.add("question", ConfigValue::make_string(question.words));
  object.add("persons", ConfigValue::make_integer(share.persons));
  add_count(object, share.all);
  object.add("bootstrap", share.bootstrap ? interval_json(*share.bootstrap) : ConfigValue::make_null());
  object.add("student_t", share.student ? interval_json(*share.student) : ConfigValue::make_null());
  object.add("prefer_left", ConfigValue::make_integer(share.prefer_left));
  for (const auto& [pair, count] : share.by_pair) {
    ConfigValue entry = ConfigValue::make_object();
    entry.add("name", ConfigValue::make_string(key.pairs[pair].name));
    add_count(entry, count);
    pairs.items.push_back(std::move(entry));
  }
  object.add("pairs", std::move(pairs));
  return object;
}

}  // namespace

ShareInterval wilson_interval(const StudyCount& count) {
  HSI4D_CHECK(count.answers > 0, "an interval of no answers was asked for");
  const auto n = static_cast<double>(count.answers);
  const double z = kNormalQuantile, p = count.share();
  const double middle = p + z * z / (2 * n), half = z * std::sqrt(p * (1 - p) / n + z * z / (4 * n * n)),
               scale = 1 + z * z / n;
  return {std::max(0.0, (middle - half) / scale), std::min(1.0, (middle + half) / scale)};
}

ShareInterval person_bootstrap(const std::vector<StudyCount>& persons) {
  HSI4D_CHECK(!persons.empty(), "a bootstrap of no persons was asked for");
  RandomSequence random(0, kStream);
  std::vector<double> shares;
  shares.reserve(kStudyResamples);
  for (int i = 0; i < kStudyResamples; ++i) {
    StudyCount sum;
    for (std::size_t k = 0; k < persons.size(); ++k) {
      const StudyCount& drawn = persons[random.below(persons.size())];
      sum.answers += drawn.answers;
      sum.prefer_a += drawn.prefer_a;
    }
    shares.push_back(sum.share());
  }
  std::sort(shares.begin(), shares.end());
  const double tail = (1 - kStudyConfidence) / 2;
  return {quantile(shares, tail), quantile(shares, 1 - tail)};
}

double student_quantile(Index freedom) {
  HSI4D_CHECK(freedom > 0, "Student's t was asked for without a degree of freedom");
  double low = 0, high = std::numbers::pi / 2;
  for (int halving = 0; halving < 100; ++halving) {
    const double middle = (low + high) / 2;
    (student_share(middle, freedom) < kStudyConfidence ? low : high) = middle;
  }
  return std::tan((low + high) / 2) * std::sqrt(static_cast<double>(freedom));
}

ShareInterval person_student(const std::vector<StudyCount>& persons) {
  HSI4D_CHECK(persons.size() > 1, "Student's interval was asked for of fewer than two persons");
  StudyCount all;
  for (const StudyCount& person : persons) {
    all.answers += person.answers;
    all.prefer_a += person.prefer_a;
  }
  double squares = 0;
  for (const StudyCount& person : persons) {
    const double away = static_cast<double>(person.prefer_a) - static_cast<double>(person.answers) * all.share();
    squares += away * away;
  }
  const auto m = static_cast<double>(persons.size());
  const double half =
      student_quantile(std::ssize(persons) - 1) * std::sqrt(m / (m - 1) * squares) / static_cast<double>(all.answers);
  return {std::max(0.0, all.share() - half), std::min(1.0, all.share() + half)};
}

std::vector<std::string> study_cautions(const std::vector<StudyShare>& shares) {
  std::vector<std::string> notes;
  for (const StudyShare& share : shares) {
    if (share.persons >= kFewPersons) continue;
    const std::string name(kStudyQuestions[share.question].id);
    if (share.persons == 1)
      notes.push_back(name +
                      ": one person: nothing is known of how people differ, and the interval of answers is no more "
                      "than that of this person");
    else
      notes.push_back(
          name + ": " + std::to_string(share.persons) + " persons: of fewer than " + std::to_string(kFewPersons) +
          " both intervals over persons are rough, the bootstrap's is too narrow; Student's t is the one to "
          "quote");
  }
  return notes;
}

std::vector<StudyShare> study_shares(const StudyAnswers& answers) {
  std::vector<StudyShare> shares;
  for (std::size_t question = 0; question < kStudyQuestions.size(); ++question) {
    StudyShare share = share_of(question, answers);
    if (share.all.answers > 0) shares.push_back(std::move(share));
  }
  return shares;
}

std::string study_results_json(const StudyKey& key, const StudyAnswers& answers,
                               const std::vector<StudyShare>& shares) {
  ConfigValue root = ConfigValue::make_object(), questions = ConfigValue::make_array(),
              notes = ConfigValue::make_array();
  root.add("study", ConfigValue::make_string(key.study));
  root.add("a", ConfigValue::make_string(key.a));
  root.add("b", ConfigValue::make_string(key.b));
  root.add("persons", ConfigValue::make_integer(std::ssize(answers.persons)));
  root.add("pairs", ConfigValue::make_integer(std::ssize(key.pairs)));
  root.add("confidence", ConfigValue::make_number(kStudyConfidence));
  for (const StudyShare& share : shares) questions.items.push_back(share_json(key, share));
  for (const std::string& note : study_cautions(shares)) notes.items.push_back(ConfigValue::make_string(note));
  for (const std::string& note : answers.notes) notes.items.push_back(ConfigValue::make_string(note));
  root.add("questions", std::move(questions));
  root.add("notes", std::move(notes));
  return to_json(root);
}

std::string study_answers_csv(const StudyKey& key, const StudyAnswers& answers) {
  Table table{.head = {"person", "pair", "question", "prefers", "left", "seconds", "plays"}};
  for (const StudyPerson& person : answers.persons) {
    for (const StudyAnswer& answer : person.answers)
      table.rows.push_back({person.person, key.pairs[answer.pair].name, kStudyQuestions[answer.question].id,
                            answer.prefers_a ? "A" : "B", answer.a_is_left ? "A" : "B", number_text(answer.seconds),
                            number_text(answer.plays)});
  }
  return table_csv(table);
}

}  // namespace hsi4d
