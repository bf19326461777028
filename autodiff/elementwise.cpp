#include "autodiff/elementwise.h"

#include "autodiff/map.h"

namespace hsi4d {

namespace {

// Each function: its value, and beside it the partial derivatives, from the same arguments. A parameter (a plain
// number) is a member.

template <class S>
struct AddNumber {
  static constexpr const char* kName = "add";
  S number;
  S value(S x) const { return x + number; }
  template <class>
  S partials(S* p, S x) const {
    p[0] = 1;
    return x + number;
  }
};

template <class S>
struct ScaleBy {
  static constexpr const char* kName = "scale";
  S number;
  S value(S x) const { return x * number; }
  template <class>
  S partials(S* p, S x) const {
    p[0] = number;
    return x * number;
  }
};

template <class S>
struct NumberMinus {
  static constexpr const char* kName = "subtract";
  S number;
  S value(S x) const { return number - x; }
  template <class>
  S partials(S* p, S x) const {
    p[0] = -1;
    return number - x;
  }
};

template <class S>
struct NumberOver {
  static constexpr const char* kName = "divide";
  S number;
  S value(S x) const { return number / x; }
  template <class>
  S partials(S* p, S x) const {
    const S y = number / x;
    p[0] = -y / x;
    return y;
  }
};

template <class S>
struct OverNumber {
  static constexpr const char* kName = "divide";
  S number;
  S value(S x) const { return x / number; }
  template <class>
  S partials(S* p, S x) const {
    p[0] = 1 / number;
    return x / number;
  }
};

template <class S>
struct Add {
  static constexpr const char* kName = "add";
  S value(S a, S b) const { return a + b; }
  template <class>
  S partials(S* p, S a, S b) const {
    p[0] = p[1] = 1;
    return a + b;
  }
};

template <class S>
struct Subtract {
  static constexpr const char* kName = "subtract";
  S value(S a, S b) const { return a - b; }
  template <class>
  S partials(S* p, S a, S b) const {
    p[0] = 1;
    p[1] = -1;
    return a - b;
  }
};

template <class S>
struct Multiply {
  static constexpr const char* kName = "multiply";
  S value(S a, S b) const { return a * b; }
  template <class>
  S partials(S* p, S a, S b) const {
    p[0] = b;
    p[1] = a;
    return a * b;
  }
};

template <class S>
struct Divide {
  static constexpr const char* kName = "divide";
  S value(S a, S b) const { return a / b; }
  template <class>
  S partials(S* p, S a, S b) const {
    const S y = a / b;
    p[0] = 1 / b;
    p[1] = -y / b;
    return y;
  }
};

template <class S>
struct Minimum {
  static constexpr const char* kName = "min";
  static bool is_second(S a, S b) { return b < a || b != b; }  // NaN of either: a comparison alone would lose b's
  S value(S a, S b) const { return is_second(a, b) ? b : a; }
  template <class>
  S partials(S* p, S a, S b) const {
    p[0] = is_second(a, b) ? S(0) : S(1);
    p[1] = is_second(a, b) ? S(1) : S(0);
    return value(a, b);
  }
};

template <class S>
struct Maximum {
  static constexpr const char* kName = "max";
  static bool is_second(S a, S b) { return b > a || b != b; }
  S value(S a, S b) const { return is_second(a, b) ? b : a; }
  template <class>
  S partials(S* p, S a, S b) const {
    p[0] = is_second(a, b) ? S(0) : S(1);
    p[1] = is_second(a, b) ? S(1) : S(0);
    return value(a, b);
  }
};

template <class S>
struct Clamp {
  static constexpr const char* kName = "clamp";
  S low, high;
  S value(S x) const { return x < low ? low : (x > high ? high : x); }
  template <class>
  S partials(S* p, S x) const {
    p[0] = x < low || x > high ? S(0) : S(1);
    return value(x);
  }
};

template <class S>
struct Absolute {
  static constexpr const char* kName = "abs";
  S value(S x) const { return std::fabs(x); }
  template <class>
  S partials(S* p, S x) const {
    p[0] = S(x > 0) - S(x < 0);
    return std::fabs(x);
  }
};

template <class S>
struct Square {
  static constexpr const char* kName = "square";
  static constexpr S kCurvature = 2;
  S value(S x) const { return x * x; }
  template <class>
  S partials(S* p, S x) const {
    p[0] = 2 * x;
    return x * x;
  }
};

template <class S>
struct SquareRoot {
  static constexpr const char* kName = "sqrt";
  S value(S x) const { return std::sqrt(x); }
  template <class>
  S partials(S* p, S x) const {
    const S y = std::sqrt(x);
    p[0] = y == 0 ? S(0) : S(0.5) / y;
    return y;
  }
};

template <class S>
struct Exponential {
  static constexpr const char* kName = "exp";
  S value(S x) const { return vector_exp(x); }
  template <class>
  S partials(S* p, S x) const {
    return p[0] = vector_exp(x);
  }
};

template <class S>
struct Logarithm {
  static constexpr const char* kName = "log";
  S value(S x) const { return std::log(x); }
  template <class>
  S partials(S* p, S x) const {
    p[0] = 1 / x;
    return std::log(x);
  }
};

template <class S>
struct Sine {
  static constexpr const char* kName = "sin";
  S value(S x) const { return std::sin(x); }
  template <class>
  S partials(S* p, S x) const {
    p[0] = std::cos(x);
    return std::sin(x);
  }
};

template <class S>
struct Cosine {
  static constexpr const char* kName = "cos";
  S value(S x) const { return std::cos(x); }
  template <class>
  S partials(S* p, S x) const {
    p[0] = -std::sin(x);
    return std::cos(x);
  }
};

template <class S>
struct HyperbolicTangent {
  static constexpr const char* kName = "tanh";
  S value(S x) const { return std::tanh(x); }
  template <class>
  S partials(S* p, S x) const {
    // 1 − tanh² = 1 / cosh², which keeps its relative accuracy in saturation.
    const S e = vector_exp(-2 * std::fabs(x));
    p[0] = 4 * e / ((1 + e) * (1 + e));
    return std::tanh(x);
  }
};

template <class S>
struct Sigmoid {
  static constexpr const char* kName = "sigmoid";
  S value(S x) const { return sigmoid(x); }
  template <class>
  S partials(S* p, S x) const {
    p[0] = sigmoid_derivative(x);
    return sigmoid(x);
  }
};

template <class S>
struct Softplus {
  static constexpr const char* kName = "softplus";
  S value(S x) const { return softplus(x); }
  template <class>
  S partials(S* p, S x) const {
    p[0] = sigmoid(x);
    return softplus(x);
  }
};

template <class S>
struct LeakyRelu {
  static constexpr const char* kName = "leaky_relu";
  S slope;
  S value(S x) const { return x > 0 ? x : slope * x; }
  template <class>
  S partials(S* p, S x) const {
    p[0] = x > 0 ? S(1) : slope;
    return value(x);
  }
};

/// Copies; has no adjoint. As an operator of its own it cuts the graph without freezing x for other users.
template <class S>
struct StopGradientOp {
  static constexpr const char* kName = "stop_gradient";
  void forward(NodeIo<S>& io) { std::copy_n(io.in(0).data, io.in(0).shape.memory(), io.out().data); }
  void backward(NodeIo<S>&) {}
};

template <class S, class F>
Var<S> unary(Var<S> x, const F& f, const Source& where) {
  const Shape shape = x.shape();
  return x.owner().record(MapOp<S, 1, F>{f}, {x}, shape, where);
}

template <class S, class F>
Var<S> binary(Var<S> a, Var<S> b, const F& f, const Source& where) {
  const Shape shape = broadcast_shape(a.shape(), b.shape());
  return a.owner().record(MapOp<S, 2, F>{f}, {a, b}, shape, where);
}

}  // namespace

template <class S>
Var<S> operator+(Var<S> a, std::type_identity_t<Operand<S>> b) {
  if (b.is_number) return unary(a, AddNumber<S>{b.number}, b.where);
  return binary(a, b.var, Add<S>{}, b.where);
}
template <class S>
Var<S> operator-(Var<S> a, std::type_identity_t<Operand<S>> b) {
  if (b.is_number) return unary(a, AddNumber<S>{-b.number}, b.where);
  return binary(a, b.var, Subtract<S>{}, b.where);
}
template <class S>
Var<S> operator*(Var<S> a, std::type_identity_t<Operand<S>> b) {
  if (b.is_number) return unary(a, ScaleBy<S>{b.number}, b.where);
  return binary(a, b.var, Multiply<S>{}, b.where);
}
template <class S>
Var<S> operator/(Var<S> a, std::type_identity_t<Operand<S>> b) {
  if (b.is_number) return unary(a, OverNumber<S>{b.number}, b.where);
  return binary(a, b.var, Divide<S>{}, b.where);
}
template <class S>
Var<S> operator+(std::type_identity_t<Number<S>> a, Var<S> b) {
  return unary(b, AddNumber<S>{a.value}, a.where);
}
template <class S>
Var<S> operator-(std::type_identity_t<Number<S>> a, Var<S> b) {
  return unary(b, NumberMinus<S>{a.value}, a.where);
}
template <class S>
Var<S> operator*(std::type_identity_t<Number<S>> a, Var<S> b) {
  return unary(b, ScaleBy<S>{a.value}, a.where);
}
template <class S>
Var<S> operator/(std::type_identity_t<Number<S>> a, Var<S> b) {
  return unary(b, NumberOver<S>{a.value}, a.where);
}
template <class S>
Var<S> operator-(Var<S> a) {
  return unary(a, ScaleBy<S>{-1}, Source::current());
}

// clang-format off
template <class S> Var<S> min(Var<S> a, Var<S> b, Source where) { return binary(a, b, Minimum<S>{}, where); }
template <class S> Var<S> max(Var<S> a, Var<S> b, Source where) { return binary(a, b, Maximum<S>{}, where); }
template <class S> Var<S> clamp(Var<S> x, double low, double high, Source where) {
  return unary(x, Clamp<S>{static_cast<S>(low), static_cast<S>(high)}, where);
}
template <class S> Var<S> abs(Var<S> x, Source where) { return unary(x, Absolute<S>{}, where); }
template <class S> Var<S> square(Var<S> x, Source where) { return unary(x, Square<S>{}, where); }
template <class S> Var<S> sqrt(Var<S> x, Source where) { return unary(x, SquareRoot<S>{}, where); }
template <class S> Var<S> exp(Var<S> x, Source where) { return unary(x, Exponential<S>{}, where); }
template <class S> Var<S> log(Var<S> x, Source where) { return unary(x, Logarithm<S>{}, where); }
template <class S> Var<S> sin(Var<S> x, Source where) { return unary(x, Sine<S>{}, where); }
template <class S> Var<S> cos(Var<S> x, Source where) { return unary(x, Cosine<S>{}, where); }
template <class S> Var<S> tanh(Var<S> x, Source where) { return unary(x, HyperbolicTangent<S>{}, where); }
template <class S> Var<S> sigmoid(Var<S> x, Source where) { return unary(x, Sigmoid<S>{}, where); }
template <class S> Var<S> softplus(Var<S> x, Source where) { return unary(x, Softplus<S>{}, where); }
template <class S> Var<S> leaky_relu(Var<S> x, double slope, Source where) {
  return unary(x, LeakyRelu<S>{static_cast<S>(slope)}, where);
}
template <class S> Var<S> stop_gradient(Var<S> x, Source where) {
  Var<S> y = x.owner().record(StopGradientOp<S>{}, {x}, x.shape(), where);
  x.tape->freeze(y);
  return y;
}

bool is_stop_gradient(std::string_view operator_name) { return operator_name == StopGradientOp<double>::kName; }

#define HSI4D_ELEMENTWISE(S)                                                    \
  template Var<S> operator+(Var<S>, std::type_identity_t<Operand<S>>);          \
  template Var<S> operator-(Var<S>, std::type_identity_t<Operand<S>>);          \
  template Var<S> operator*(Var<S>, std::type_identity_t<Operand<S>>);          \
  template Var<S> operator/(Var<S>, std::type_identity_t<Operand<S>>);          \
  template Var<S> operator+(std::type_identity_t<Number<S>>, Var<S>);           \
  template Var<S> operator-(std::type_identity_t<Number<S>>, Var<S>);           \
  template Var<S> operator*(std::type_identity_t<Number<S>>, Var<S>);           \
  template Var<S> operator/(std::type_identity_t<Number<S>>, Var<S>);           \
  template Var<S> operator-(Var<S>);                                            \
  template Var<S> min(Var<S>, Var<S>, Source);                                  \
  template Var<S> max(Var<S>, Var<S>, Source);                                  \
  template Var<S> clamp(Var<S>, double, double, Source);             \
  template Var<S> abs(Var<S>, Source);                                          \
  template Var<S> square(Var<S>, Source);                                       \
  template Var<S> sqrt(Var<S>, Source);                                         \
  template Var<S> exp(Var<S>, Source);                                          \
  template Var<S> log(Var<S>, Source);                                          \
  template Var<S> sin(Var<S>, Source);                                          \
  template Var<S> cos(Var<S>, Source);                                          \
  template Var<S> tanh(Var<S>, Source);                                         \
  template Var<S> sigmoid(Var<S>, Source);                                      \
  template Var<S> softplus(Var<S>, Source);                                     \
  template Var<S> leaky_relu(Var<S>, double, Source);                           \
  template Var<S> stop_gradient(Var<S>, Source);
HSI4D_ELEMENTWISE(float)
HSI4D_ELEMENTWISE(double)
#undef HSI4D_ELEMENTWISE
// clang-format on

}  // namespace hsi4d
