// check_operator itself must be able to fail: operators that are wrong on purpose, each in one way. Catch counts these
// tests as passed when, and only when, a check in them fails.
#include "tests/support/operator_check.h"

namespace faulty_operator_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

enum class Fault {
  kNone,
  kHalvedAdjoint,
  kOverwrites,
  kIgnoresAssign,
  kSkipsOutput,
  kWritesInput,
  kRemembers,
  kFreezeMatters
};

/// y = a b, with a fault.
template <class S>
struct FaultyOp {
  static constexpr const char* kName = "faulty";
  static constexpr bool kAssigns = true;
  Fault fault;
  S memory = 0;

  void forward(NodeIo<S>& io) {
    const Index n = io.out().shape.count();
    for (Index i = fault == Fault::kSkipsOutput ? 1 : 0; i < n; ++i) {
      io.out().data[i] = io.in(0).data[i] * io.in(1).data[i] + memory;
    }
    if (fault == Fault::kRemembers) memory = io.in(0).data[0];
    if (fault == Fault::kWritesInput) const_cast<S*>(io.in(0).data)[0] += S(1);
  }
  void backward(NodeIo<S>& io) {
    for (const int k : {0, 1}) {
      if (!io.wants(k)) continue;
      const bool assign = (io.must_assign(k) && fault != Fault::kIgnoresAssign) || fault == Fault::kOverwrites;
      S scale = fault == Fault::kHalvedAdjoint && k == 1 ? S(0.5) : S(1);
      if (fault == Fault::kFreezeMatters && !io.wants(1 - k)) scale = S(1.0001);
      for (Index i = 0; i < io.d_out().shape.count(); ++i) {
        const S d = scale * io.d_out().data[i] * io.in(1 - k).data[i];
        io.d_in(k).data[i] = assign ? d : io.d_in(k).data[i] + d;
      }
    }
  }
};

void check_faulty(Fault fault) {
  check_operator("faulty", {{"a", shape_of(4, 3)}, {"b", shape_of(4, 3)}}, [&](const auto& in) {
    using S = std::remove_cvref_t<decltype(*in[0].owner().value(in[0]).data)>;
    return in[0].owner().record(FaultyOp<S>{fault}, {in[0], in[1]}, in[0].shape(), Source::current());
  });
}

}  // namespace

// Without a fault the same operator passes, so that each failure below is its fault's.
TEST_CASE("check_operator passes the operator that has no fault") { check_faulty(Fault::kNone); }

TEST_CASE("check_operator sees an adjoint that is half of what it should be", "[!shouldfail]") {
  check_faulty(Fault::kHalvedAdjoint);
}
TEST_CASE("check_operator sees an adjoint that overwrites", "[!shouldfail]") { check_faulty(Fault::kOverwrites); }
TEST_CASE("check_operator sees an adjoint that adds to undefined memory", "[!shouldfail]") {
  check_faulty(Fault::kIgnoresAssign);
}
TEST_CASE("check_operator sees a number that is not written", "[!shouldfail]") { check_faulty(Fault::kSkipsOutput); }
TEST_CASE("check_operator sees an input that is written", "[!shouldfail]") { check_faulty(Fault::kWritesInput); }
TEST_CASE("check_operator sees a result that depends on the one before", "[!shouldfail]") {
  check_faulty(Fault::kRemembers);
}
TEST_CASE("check_operator sees a gradient that changes when another input is frozen", "[!shouldfail]") {
  check_faulty(Fault::kFreezeMatters);
}

}  // namespace faulty_operator_test
