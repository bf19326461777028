#include "pipelines/cli/failure.h"

#include <new>

#include "core/check.h"
#include "core/observer.h"

namespace hsi4d::cli {

namespace {

constexpr const char* kReport = "this is a bug in hsi4d, please report it: ";

}  // namespace

Failure describe_failure(const std::exception_ptr& error) {
  try {
    std::rethrow_exception(error);
  } catch (const UserError& mistake) {
    return {kUserMistake, mistake.what()};
  } catch (const DataError& mistake) {
    return {kUserMistake, mistake.what()};
  } catch (const Interrupted& stop) {
    return {kInterrupted, "hsi4d: " + std::string(stop.what())};
  } catch (const std::bad_alloc&) {
    return {kUserMistake, "hsi4d: there is not enough memory for this"};
  } catch (const std::exception& bug) {
    return {kOurBug, kReport + std::string(bug.what())};
  } catch (...) {
    return {kOurBug, kReport + std::string("an exception of unknown type")};
  }
}

}  // namespace hsi4d::cli
