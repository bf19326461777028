// Shares and intervals of a study, against numbers known from elsewhere and properties that define them.
#include "pipelines/study/results.h"

#include <cmath>

#include <catch2/catch.hpp>

namespace results_test {

using namespace hsi4d;

TEST_CASE("the interval of a share is Wilson's") {
  // Newcombe 1998, "Two-sided confidence intervals for the single proportion", Stat. Med. 17, table I, method 3.
  const auto check = [](Index prefer_a, Index answers, double low, double high) {
    const ShareInterval interval = wilson_interval({answers, prefer_a});
    CHECK(interval.low == Approx(low).margin(5e-5));
    CHECK(interval.high == Approx(high).margin(5e-5));
  };
  check(81, 263, 0.2553, 0.3662);
  check(15, 148, 0.0624, 0.1605);
  check(0, 20, 0, 0.1611);
  check(1, 29, 0.0061, 0.1718);
  // Its ends are the shares from which what was seen is 1.96 standard errors away.
  for (const Index n : {1, 3, 10, 250}) {
    for (Index k = 0; k <= n; ++k) {
      const ShareInterval interval = wilson_interval({n, k});
      const double p = static_cast<double>(k) / static_cast<double>(n);
      for (const double end : {interval.low, interval.high}) {
        if (end > 1e-12 && end < 1 - 1e-12)
          CHECK(std::fabs(p - end) ==
                Approx(1.959964 * std::sqrt(end * (1 - end) / static_cast<double>(n))).margin(1e-6));
      }
      const ShareInterval other = wilson_interval({n, n - k});
      CHECK(interval.low == Approx(1 - other.high).margin(1e-12));
    }
  }
}

TEST_CASE("the bootstrap draws persons with all their answers") {
  // One answer each: the binomial's spread.
  std::vector<StudyCount> single(400, {1, 0});
  for (std::size_t i = 0; i < 240; ++i) single[i].prefer_a = 1;
  const ShareInterval alone = person_bootstrap(single);
  const double half = 1.959964 * std::sqrt(0.6 * 0.4 / 400);
  CHECK(alone.low == Approx(0.6 - half).margin(0.006));
  CHECK(alone.high == Approx(0.6 + half).margin(0.006));
  // Ten answers each, all alike: no more is known than from one answer each, whatever Wilson's interval says.
  std::vector<StudyCount> alike(40, {10, 0});
  for (std::size_t i = 0; i < 24; ++i) alike[i].prefer_a = 10;
  const ShareInterval groups = person_bootstrap(alike), wilson = wilson_interval({400, 240});
  const double wide = 1.959964 * std::sqrt(0.6 * 0.4 / 40);
  CHECK(groups.low == Approx(0.6 - wide).margin(0.02));
  CHECK(groups.high == Approx(0.6 + wide).margin(0.02));
  CHECK(groups.high - groups.low > 2.5 * (wilson.high - wilson.low));
  // Persons that do not differ leave nothing open, and those with more answers count for more.
  const ShareInterval same = person_bootstrap(std::vector<StudyCount>(5, {10, 7}));
  CHECK(same.low == 0.7);
  CHECK(same.high == 0.7);
  CHECK(person_bootstrap({{10, 10}, {1, 0}}).high == 1);
  CHECK(person_bootstrap(alike).low == groups.low);
}

TEST_CASE("Student's t is that of the tables") {
  // Abramowitz and Stegun, table 26.10, 0.975.
  for (const auto& [freedom, value] : {std::pair<Index, double>{1, 12.706},
                                       {2, 4.303},
                                       {3, 3.182},
                                       {4, 2.776},
                                       {9, 2.262},
                                       {10, 2.228},
                                       {30, 2.042},
                                       {120, 1.980}})
    CHECK(student_quantile(freedom) == Approx(value).margin(5e-4));
  CHECK(student_quantile(100000) == Approx(1.959964).margin(5e-5));
}

TEST_CASE("Student's interval over persons is that of their shares where they answer alike often") {
  // Shares 0.9, 0.6, 0.7, 0.4: mean 0.65, standard deviation 0.20817, 3.1824 of it over two to either side.
  const ShareInterval four = person_student({{10, 9}, {10, 6}, {10, 7}, {10, 4}});
  CHECK(four.low == Approx(0.65 - 3.1824463 * 0.2081666 / 2).margin(1e-6));
  CHECK(four.high == Approx(0.65 + 3.1824463 * 0.2081666 / 2).margin(1e-6));
  // Wider than the bootstrap's of few persons, and the same for many.
  const ShareInterval narrow = person_bootstrap({{10, 9}, {10, 6}, {10, 7}, {10, 4}});
  CHECK(four.high - four.low > 1.5 * (narrow.high - narrow.low));
  std::vector<StudyCount> many;
  for (int i = 0; i < 400; ++i) many.push_back({10, i % 11});
  const ShareInterval t = person_student(many), drawn = person_bootstrap(many);
  CHECK(t.low == Approx(drawn.low).margin(0.003));
  CHECK(t.high == Approx(drawn.high).margin(0.003));
  CHECK(person_student({{1, 1}, {1, 0}}).low == 0);
  CHECK(person_student({{1, 1}, {1, 0}}).high == 1);
}

TEST_CASE("the intervals of a study do not depend on the order of its files") {
  StudyAnswers answers, turned;
  const std::vector<int> for_a = {3, 0, 2, 3, 1};
  for (int i = 0; i < 5; ++i) {
    StudyPerson person{std::string(1, static_cast<char>('a' + i)), "", "", "", {}};
    for (std::size_t k = 0; k < 3; ++k)
      person.answers.push_back({k, 0, static_cast<int>(k) < for_a[static_cast<std::size_t>(i)], true, 1, 1});
    answers.persons.push_back(person);
    turned.persons.insert(turned.persons.begin(), person);
  }
  const StudyShare one = study_shares(answers)[0], other = study_shares(turned)[0];
  CHECK(one.bootstrap->low == other.bootstrap->low);
  CHECK(one.bootstrap->high == other.bootstrap->high);
  CHECK(one.student->low == other.student->low);
  CHECK(study_cautions({one}) ==
        std::vector<std::string>{"quality: 5 persons: of fewer than 10 both intervals over persons are rough, the "
                                 "bootstrap's is too narrow; Student's t is the one to quote"});
  StudyShare more = one;
  more.persons = 10;
  CHECK(study_cautions({more}).empty());
}

TEST_CASE("answers are counted by question, pair and side") {
  StudyAnswers answers;
  answers.persons = {
      {"x", "x.json", "", "", {{0, 0, true, true, 3, 1}, {0, 1, false, true, 3, 1}, {1, 0, true, false, 4.5, 0}}},
      {"y", "y.json", "", "", {{0, 0, false, true, 2, 7}}}};
  const std::vector<StudyShare> shares = study_shares(answers);
  REQUIRE(shares.size() == 2);
  CHECK(shares[0].persons == 2);
  CHECK(shares[0].all.answers == 3);
  CHECK(shares[0].all.prefer_a == 2);
  CHECK(shares[0].prefer_left == 1);
  REQUIRE(shares[0].by_pair.size() == 2);
  CHECK(shares[0].by_pair[0].second.answers == 2);
  CHECK(shares[0].by_pair[0].second.prefer_a == 1);
  CHECK(shares[0].by_pair[1].second.prefer_a == 1);
  CHECK(shares[0].bootstrap.has_value());
  CHECK(shares[1].all.prefer_a == 0);
  CHECK_FALSE(shares[1].bootstrap.has_value());
  StudyKey key;
  key.pairs = {{"p", "sits, then \"stands\"", "sits", "a", "b"}, {"q", "walk", "", "c", "d"}};
  CHECK(study_answers_csv(key, answers) ==
        "person,pair,question,prefers,left,seconds,plays\n"
        "x,\"sits, then \"\"stands\"\"\",quality,A,A,3,1\n"
        "x,\"sits, then \"\"stands\"\"\",text,B,A,3,1\n"
        "x,walk,quality,A,B,4.5,0\n"
        "y,\"sits, then \"\"stands\"\"\",quality,B,A,2,7\n");
}

}  // namespace results_test
