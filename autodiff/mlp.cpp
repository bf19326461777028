#include "autodiff/mlp.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "autodiff/dual.h"
#include "autodiff/mlp_kernel.h"
#include "core/parallel.h"
#include "core/simd.h"
#include "core/vector_exp.h"
#include "core/workspaces.h"

namespace hsi4d {

namespace {

using detail::kMlpBlock;
using detail::MlpKernels;
using detail::MlpStep;

/// Rows of a parallel chunk.
constexpr Index kChunkRows = 16 * kMlpBlock;

// --- between rows and blocks, [width][kMlpBlock] ---------------------------------------------------------------------

/// Four rows of four floats, transposed.
struct FourByFour {
  typedef float Four __attribute__((vector_size(16)));

  static void move(const float* from, Index from_step, float* to, Index to_step) {
    Four a, b, c, d;
    std::memcpy(&a, from, sizeof a);
    std::memcpy(&b, from + from_step, sizeof b);
    std::memcpy(&c, from + 2 * from_step, sizeof c);
    std::memcpy(&d, from + 3 * from_step, sizeof d);
    const Four ab_low = __builtin_shufflevector(a, b, 0, 4, 1, 5), ab_high = __builtin_shufflevector(a, b, 2, 6, 3, 7);
    const Four cd_low = __builtin_shufflevector(c, d, 0, 4, 1, 5), cd_high = __builtin_shufflevector(c, d, 2, 6, 3, 7);
    a = __builtin_shufflevector(ab_low, cd_low, 0, 1, 4, 5);
    b = __builtin_shufflevector(ab_low, cd_low, 2, 3, 6, 7);
    c = __builtin_shufflevector(ab_high, cd_high, 0, 1, 4, 5);
    d = __builtin_shufflevector(ab_high, cd_high, 2, 3, 6, 7);
    std::memcpy(to, &a, sizeof a);
    std::memcpy(to + to_step, &b, sizeof b);
    std::memcpy(to + 2 * to_step, &c, sizeof c);
    std::memcpy(to + 3 * to_step, &d, sizeof d);
  }
};

/// block[c][r] = x(first + r, c) for `count` rows, and 0 for the rest of the block.
template <class S>
void load_block(const ConstArray<S>& x, Index first, Index count, S* block) {
  const Index cols = x.shape.cols, stride = x.shape.stride;
  const S* from = x.row(first);
  Index whole = 0;  // rows and columns moved four by four
  if constexpr (sizeof(S) == 4) {
    whole = count / 4 * 4;
    for (Index r = 0; r < whole; r += 4) {
      for (Index c = 0; c + 4 <= cols; c += 4) {
        FourByFour::move(from + r * stride + c, stride, block + c * kMlpBlock + r, kMlpBlock);
      }
    }
  }
  for (Index c = 0; c < cols; ++c) {
    S* line = block + c * kMlpBlock;
    const Index moved = c < cols / 4 * 4 ? whole : 0;
    for (Index r = moved; r < count; ++r) line[r] = from[r * stride + c];
    for (Index r = count; r < kMlpBlock; ++r) line[r] = S(0);
  }
}

/// x(first + r, c) = block[c][r], or += it.
template <class S>
void store_block(const S* block, Index first, Index count, bool assigns, const Array<S>& x) {
  const Index cols = x.shape.cols, stride = x.shape.stride;
  S* to = x.row(first);
  Index whole = 0;
  if constexpr (sizeof(S) == 4) {
    whole = count / 4 * 4;
    for (Index r = 0; r < whole; r += 4) {
      for (Index c = 0; c + 4 <= cols; c += 4) {
        S four[16];
        FourByFour::move(block + c * kMlpBlock + r, kMlpBlock, four, 4);
        for (Index i = 0; i < 4; ++i) {
          S* row = to + (r + i) * stride + c;
          for (Index j = 0; j < 4; ++j) row[j] = assigns ? four[4 * i + j] : row[j] + four[4 * i + j];
        }
      }
    }
  }
  for (Index c = 0; c < cols; ++c) {
    const S* line = block + c * kMlpBlock;
    for (Index r = c < cols / 4 * 4 ? whole : 0; r < count; ++r) {
      S& number = to[r * stride + c];
      number = assigns ? line[r] : number + line[r];
    }
  }
}

// --- the output function ---------------------------------------------------------------------------------------------

/// σ' = e/(1 + e)², e = exp(−|z|), of d_z = d_y σ'(z), which is right where 1 − σ is rounded away.
template <class S>
S sigmoid_slope(S z) {
  const S e = vector_exp(-std::fabs(z)), over = S(1) / (S(1) + e);
  return e * over * over;
}

// --- the operator ----------------------------------------------------------------------------------------------------

template <class S>
struct MlpOp {
  static constexpr const char* kName = "mlp";
  static constexpr bool kAssigns = true;

  MlpOutput output;
  int layers = 0;
  int more = -1, code = -1, offset = -1, first_weights = 1;  // inputs; −1: not there. Input 0 is rows.
  std::array<Index, kMostMlpLayers + 1> widths{};            // per row: of the input, and of each layer's output

  int weights(int layer) const { return first_weights + 2 * layer; }
  int bias(int layer) const { return first_weights + 2 * layer + 1; }
  bool wants(const NodeIo<S>& io, int input) const { return input >= 0 && io.wants(input); }
  Index width(int layer) const { return widths[static_cast<std::size_t>(layer)]; }
  Index outputs() const { return width(layers); }
  Index widest() const { return *std::max_element(widths.begin(), widths.begin() + layers + 1); }

  /// Layer l for every row. `shared` gets b_1 and what the code adds to it.
  struct Network {
    std::array<MlpStep<S>, kMostMlpLayers> steps;
    MlpKernels<S> kernels;
  };
  Network network(const NodeIo<S>& io, std::span<S> shared) const {
    Network net{{}, detail::mlp_kernels<S>()};
    for (int l = 0; l < layers; ++l) {
      net.steps[static_cast<std::size_t>(l)] = {io.in(weights(l)).data, io.in(bias(l)).data, width(l), width(l + 1)};
    }
    const ConstArray<S> w = io.in(weights(0)), b = io.in(bias(0));
    for (Index t = 0; t < width(1); ++t) {
      double sum = static_cast<double>(b.data[t]);
      for (Index p = 0; code >= 0 && p < io.in(code).shape.cols; ++p) {
        sum += static_cast<double>(io.in(code).data[p]) * static_cast<double>(w(width(0) + p, t));
      }
      shared[static_cast<std::size_t>(t)] = static_cast<S>(sum);
    }
    net.steps[0].bias = shared.data();
    return net;
  }

  void load_input(const NodeIo<S>& io, Index first, Index count, S* x) const {
    load_block(io.in(0), first, count, x);
    if (more >= 0) load_block(io.in(more), first, count, x + io.in(0).shape.cols * kMlpBlock);
  }
  /// Adds the offset to the last layer's z.
  void add_offset(const NodeIo<S>& io, Index first, Index count, S* z) const {
    if (offset < 0) return;
    const ConstArray<S> added = io.in(offset);
    for (Index c = 0; c < outputs(); ++c) {
      for (Index r = 0; r < count; ++r) z[c * kMlpBlock + r] += added(first + r, c);
    }
  }

  void forward(NodeIo<S>& io) {
    const Array<S> y = io.out();
    const Network net = network(io, io.scratch(width(1)));
    const Index rows = y.shape.rows, line = widest() * kMlpBlock;
    detail::Workspaces workspaces(Partition{rows, kChunkRows}.chunks());
    const std::span<S> memory = io.scratch(2 * line * workspaces.count());
    parallel_for(rows, kChunkRows, [&](Index begin, Index end) {
      const detail::Workspaces::Held held(workspaces);
      on_best_isa([&] {
        for (Index first = begin; first < end; first += kMlpBlock) {
          const Index count = std::min(kMlpBlock, end - first);
          S* x = memory.data() + 2 * line * held.number();
          S* next = x + line;
          load_input(io, first, count, x);
          for (std::size_t l = 0; l + 1 < static_cast<std::size_t>(layers); ++l) {
            net.kernels.hidden(net.steps[l], x, next);
            std::swap(x, next);
          }
          net.kernels.linear(net.steps[static_cast<std::size_t>(layers - 1)], x, next);
          add_offset(io, first, count, next);
          if (output == MlpOutput::kSigmoid) {
            for (Index i = 0; i < outputs() * kMlpBlock; ++i) next[i] = sigmoid(next[i]);
          }
          store_block(next, first, count, true, y);
        }
      });
    });
  }

  /// Which sums over rows are wanted, and where they lie: [inputs, outputs] of a layer's weights, then [outputs] of its
  /// bias, for the layers that are reached.
  struct Sums {
    std::array<Index, kMostMlpLayers> weights{}, bias{};  // −1: not wanted
    Index count = 0;
    int first_layer = 0;  ///< the first whose d_z is wanted; `layers` when none is
    bool inputs = false;  ///< d_x of rows or more is wanted
  };
  Sums wanted_sums(const NodeIo<S>& io) const {
    Sums sums;
    sums.weights.fill(-1);
    sums.bias.fill(-1);
    sums.inputs = wants(io, 0) || wants(io, more);
    sums.first_layer = layers;
    for (int l = layers - 1; l >= 0; --l) {
      const auto at = static_cast<std::size_t>(l);
      const bool meets_code = l == 0 && (wants(io, code) || (code >= 0 && wants(io, weights(0))));
      if (wants(io, weights(l))) {
        sums.weights[at] = sums.count;
        sums.count += width(l) * width(l + 1);
      }
      if (wants(io, bias(l)) || meets_code) {
        sums.bias[at] = sums.count;
        sums.count += width(l + 1);
      }
      if (sums.weights[at] >= 0 || sums.bias[at] >= 0 || (l == 0 && sums.inputs)) sums.first_layer = l;
    }
    return sums;
  }

  /// Where the parts of the adjoint's workspace lie.
  struct Layout {
    Index x, z, d_z, d_y, sums, size;
    std::array<Index, kMostMlpLayers> y, slope;
  };
  Layout layout(const Sums& sums) const {
    Layout at{};
    const auto take = [&at](Index count) {
      const Index begin = at.size;
      at.size += round_up(count, kMlpBlock);
      return begin;
    };
    at.x = take(width(0) * kMlpBlock);
    for (int l = 0; l + 1 < layers; ++l) {
      at.y[static_cast<std::size_t>(l)] = take(width(l + 1) * kMlpBlock);
      at.slope[static_cast<std::size_t>(l)] = take(width(l + 1) * kMlpBlock);
    }
    at.z = take(outputs() * kMlpBlock);
    at.d_z = take(widest() * kMlpBlock);
    at.d_y = take(widest() * kMlpBlock);
    at.sums = take(sums.count);
    return at;
  }

  // d_z_L = d_out σ'(z);   d_offset += d_z_L;   d_W_l += y_{l−1}ᵀ d_z_l,  d_b_l += Σ d_z_l
  // d_z_{l−1} = (d_z_l W_lᵀ) a'(z_{l−1});   d_rows, d_more += d_z_1 W_1ᵀ;   with g = Σ d_z_1, over all rows,
  // d_code += W_1 g,  d_W_1 of the code's rows += codeᵀ g
  void backward(NodeIo<S>& io) {
    const Sums sums = wanted_sums(io);
    const Network net = network(io, io.scratch(width(1)));
    const Layout at = layout(sums);
    const Partition part = reduction_partition(io.out().shape.rows, kChunkRows);
    detail::Workspaces workspaces(part.chunks());
    const std::span<S> memory = io.scratch(at.size * workspaces.count());
    const std::span<double> totals = io.template scratch<double>(sums.count * std::max<Index>(1, part.chunks()));
    std::fill_n(totals.data(), sums.count, 0.0);  // without a row there is no chunk
    parallel_chunks(part, [&](Index chunk, Index begin, Index end) {
      const detail::Workspaces::Held held(workspaces);
      S* work = memory.data() + at.size * held.number();
      on_best_isa([&] {
        std::fill_n(work + at.sums, sums.count, S(0));
        for (Index first = begin; first < end; first += kMlpBlock) {
          const Index count = std::min(kMlpBlock, end - first);
          output_adjoint(io, net, at, sums, first, count, work);
          block_adjoint(io, net, at, sums, first, count, work);
        }
        std::copy_n(work + at.sums, sums.count, totals.data() + chunk * sums.count);
      });
    });
    add_chunks(totals.data(), part.chunks(), sums.count);
    add_sums(io, sums, totals.data());
  }

  /// Adds up the chunks' sums [chunks][count] into the first, pairwise.
  static void add_chunks(double* sums, Index chunks, Index count) {
    for (Index apart = 1; apart < chunks; apart *= 2) {
      for (Index c = 0; c + apart < chunks; c += 2 * apart) {
        for (Index i = 0; i < count; ++i) sums[c * count + i] += sums[(c + apart) * count + i];
      }
    }
  }

  /// The network's values for a block once more, and d_z of its output.
  void output_adjoint(NodeIo<S>& io, const Network& net, const Layout& at, const Sums& sums, Index first, Index count,
                      S* work) const {
    S* d_z = work + at.d_z;
    load_block(io.d_out(), first, count, d_z);
    if (output == MlpOutput::kSigmoid || sums.first_layer < layers) {
      const S* x = work + at.x;
      load_input(io, first, count, work + at.x);
      for (std::size_t l = 0; l + 1 < static_cast<std::size_t>(layers); ++l) {
        net.kernels.hidden_with_slope(net.steps[l], x, work + at.y[l], work + at.slope[l]);
        x = work + at.y[l];
      }
      if (output == MlpOutput::kSigmoid) {
        S* z = work + at.z;
        net.kernels.linear(net.steps[static_cast<std::size_t>(layers - 1)], x, z);
        add_offset(io, first, count, z);
        for (Index i = 0; i < outputs() * kMlpBlock; ++i) d_z[i] *= sigmoid_slope(z[i]);
      }
    }
    if (wants(io, offset)) store_block(d_z, first, count, io.must_assign(offset), io.d_in(offset));
  }

  /// From d_z of the output down to the first layer that is wanted.
  void block_adjoint(NodeIo<S>& io, const Network& net, const Layout& at, const Sums& sums, Index first, Index count,
                     S* work) const {
    const MlpKernels<S>& kernels = net.kernels;
    S *d_z = work + at.d_z, *d_y = work + at.d_y, *of_rows = work + at.sums;
    for (int l = layers - 1; l >= sums.first_layer; --l) {
      const auto layer = static_cast<std::size_t>(l);
      const MlpStep<S>& step = net.steps[layer];
      const S* x = l == 0 ? work + at.x : work + at.y[layer - 1];
      if (sums.weights[layer] >= 0) kernels.to_weights(step, x, d_z, of_rows + sums.weights[layer]);
      if (sums.bias[layer] >= 0) kernels.to_bias(step, d_z, of_rows + sums.bias[layer]);
      if (l == sums.first_layer) break;
      kernels.to_inputs(step, d_z, work + at.slope[layer - 1], d_y);
      std::swap(d_z, d_y);
    }
    if (!sums.inputs) return;
    const Index own = io.in(0).shape.cols;
    MlpStep<S> step = net.steps[0];
    if (wants(io, 0)) {
      step.inputs = own;
      kernels.to_inputs(step, d_z, nullptr, d_y);
      store_block(d_y, first, count, io.must_assign(0), io.d_in(0));
    }
    if (!wants(io, more)) return;
    step.inputs = width(0) - own;
    step.weights = net.steps[0].weights + own * step.outputs;
    kernels.to_inputs(step, d_z, nullptr, d_y);
    store_block(d_y, first, count, io.must_assign(more), io.d_in(more));
  }

  /// Adds the sums over all rows to the gradients of code, weights and biases.
  void add_sums(NodeIo<S>& io, const Sums& sums, const double* total) const {
    const auto put = [&io](int input, Index i, double value) {
      S& number = io.d_in(input).data[i];
      number = io.must_assign(input) ? static_cast<S>(value) : number + static_cast<S>(value);
    };
    const Index outputs_1 = width(1), own = width(0) * outputs_1;
    const double* g = sums.bias[0] < 0 ? nullptr : total + sums.bias[0];
    if (wants(io, code)) {
      const S* w = io.in(weights(0)).data + own;
      for (Index p = 0; p < io.in(code).shape.cols; ++p) {
        double sum = 0;
        for (Index t = 0; t < outputs_1; ++t) sum += static_cast<double>(w[p * outputs_1 + t]) * g[t];
        put(code, p, sum);
      }
    }
    for (int l = 0; l < layers; ++l) {
      const auto layer = static_cast<std::size_t>(l);
      if (wants(io, weights(l))) {
        for (Index i = 0; i < width(l) * width(l + 1); ++i) put(weights(l), i, total[sums.weights[layer] + i]);
      }
      if (l == 0 && code >= 0 && wants(io, weights(0))) {
        const ConstArray<S> numbers = io.in(code);
        for (Index p = 0; p < numbers.shape.cols; ++p) {
          for (Index t = 0; t < outputs_1; ++t) {
            put(weights(0), own + p * outputs_1 + t, static_cast<double>(numbers.data[p]) * g[t]);
          }
        }
      }
      if (wants(io, bias(l))) {
        for (Index t = 0; t < width(l + 1); ++t) put(bias(l), t, total[sums.bias[layer] + t]);
      }
    }
  }
};

}  // namespace

template <class S>
Var<S> mlp(const MlpInputs<S>& inputs, std::span<const MlpLayer<S>> layers, MlpOutput output, Source where) {
  HSI4D_CHECK(!layers.empty() && std::ssize(layers) <= kMostMlpLayers,
              std::to_string(layers.size()) + " layers; a network has 1 to " + std::to_string(kMostMlpLayers));
  MlpOp<S> op{output, static_cast<int>(layers.size())};
  const Index rows = inputs.rows.shape().rows;
  HSI4D_CHECK_EQ(inputs.rows.shape(), shape_of(rows, inputs.rows.shape().cols));
  std::vector<Var<S>> all = {inputs.rows};
  const auto add = [&all](Var<S> var) {
    all.push_back(var);
    return static_cast<int>(all.size()) - 1;
  };
  op.widths[0] = inputs.rows.shape().cols;
  if (inputs.more.tape != nullptr) {
    HSI4D_CHECK_EQ(inputs.more.shape(), shape_of(rows, inputs.more.shape().cols));
    op.widths[0] += inputs.more.shape().cols;
    op.more = add(inputs.more);
  }
  Index width = op.widths[0];
  if (inputs.code.tape != nullptr) {
    HSI4D_CHECK_EQ(inputs.code.shape(), shape_of(1, inputs.code.shape().cols));
    width += inputs.code.shape().cols;
    op.code = add(inputs.code);
  }
  const Index outputs = layers.back().weights.shape().cols;
  if (inputs.offset.tape != nullptr) {
    HSI4D_CHECK_EQ(inputs.offset.shape(), shape_of(rows, outputs));
    op.offset = add(inputs.offset);
  }
  op.first_weights = static_cast<int>(all.size());
  for (std::size_t l = 0; l < layers.size(); ++l) {
    HSI4D_CHECK_EQ(layers[l].weights.shape(), shape_of(width, layers[l].weights.shape().cols));
    width = op.widths[l + 1] = layers[l].weights.shape().cols;
    HSI4D_CHECK_EQ(layers[l].bias.shape(), shape_of(1, width));
    add(layers[l].weights);
    add(layers[l].bias);
  }
  return inputs.rows.owner().record(op, std::span<const Var<S>>(all), std::array{shape_of(rows, outputs)}, where);
}

double mlp_multiply_adds(Index rows, std::span<const Index> widths) {
  double per_row = 0;
  for (std::size_t l = 0; l + 1 < widths.size(); ++l) per_row += static_cast<double>(widths[l] * widths[l + 1]);
  return static_cast<double>(rows) * per_row;
}

template Var<float> mlp(const MlpInputs<float>&, std::span<const MlpLayer<float>>, MlpOutput, Source);
template Var<double> mlp(const MlpInputs<double>&, std::span<const MlpLayer<double>>, MlpOutput, Source);

}  // namespace hsi4d
