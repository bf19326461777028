#include "pipelines/cli/failure.h"

#include <functional>

#include <catch2/catch.hpp>

#include "core/check.h"

namespace failure_test {

using namespace hsi4d;

namespace {

cli::Failure failure_of(const std::function<void()>& action) {
  try {
    action();
  } catch (...) {
    return cli::describe_failure(std::current_exception());
  }
  return {0, ""};
}

}  // namespace

TEST_CASE("exit statuses tell the user's mistakes from our bugs") {
  CHECK(failure_of([] { throw UserError("mistake"); }).status == 2);
  CHECK(failure_of([] { throw DataError("bad file"); }).message == "bad file");
  CHECK(failure_of([] { throw DataError("bad file"); }).status == 2);
  const cli::Failure bug = failure_of([] { throw InternalError("impossible"); });
  CHECK(bug.status == 3);
  CHECK(bug.message == "this is a bug in hsi4d, please report it: impossible");
  CHECK(failure_of([] { throw std::runtime_error("other"); }).status == 3);
  CHECK(failure_of([] { throw 7; }).message ==
        "this is a bug in hsi4d, please report it: an exception of unknown type");
}

}  // namespace failure_test
