#include "dqslam/solver/least_squares.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <memory>
#include <optional>
#include <utility>

#include "dqslam/geometry/dispatch.h"
#include "dqslam/linear/parallel.h"
#include "dqslam/solver/linearize.h"
#include "dqslam/solver/loss.h"
#include "dqslam/solver/retraction.h"
#include "dqslam/solver/term_chunks.h"

namespace dqslam {
namespace {

using Eigen::VectorXd;

// A visitor that lists the pairs of blocks which the terms couple.
class PairCollector {
 public:
  PairCollector(const Graph& graph, const VariableIndex& variables)
      : graph_(graph), variables_(variables) {}

  template <typename Cost, typename... Rows>
  bool Visit(const Cost&, const Rows&... rows) {
    if constexpr (sizeof...(Rows) == 2) Add(variables_.Block(rows)...);
    return true;
  }
  bool VisitBox(const StageBox& box) {
    Add(variables_.Block(PoseRow{graph_.boxes.pose[box.row]}),
        variables_.Block(ObjectRow{graph_.boxes.object[box.row]}));
    return true;
  }

  // One entry for each term of two blocks, below zero if one of the two is constant.
  const std::vector<std::pair<int, int>>& all() const { return pairs_; }

 private:
  void Add(int a, int b) { pairs_.emplace_back(a, b); }

  const Graph& graph_;
  const VariableIndex& variables_;
  std::vector<std::pair<int, int>> pairs_;
};

// The pattern of H, and the block off its diagonal to which each term of two blocks adds.
struct Pattern {
  BlockMatrix H;
  std::vector<int> off_diagonal;
};

template <typename Pose>
Pattern MakePattern(const SolveContext& context, const StageTerms& terms) {
  PairCollector pairs(context.graph(), terms.variables);
  VisitTerms<Pose, EllipsoidModel>(context.prepared, terms, &pairs);
  std::vector<std::pair<int, int>> coupled;
  const auto is_free = [](const auto& pair) { return pair.first >= 0 && pair.second >= 0; };
  std::copy_if(pairs.all().begin(), pairs.all().end(), std::back_inserter(coupled), is_free);
  BlockMatrix H(context.layouts->PatternOf(terms.variables.BlockSizes(), coupled));
  std::vector<int> off_diagonal;
  for (const auto& pair : pairs.all()) {
    off_diagonal.push_back(is_free(pair) ? H.IndexOf(pair.first, pair.second) : -1);
  }
  return {std::move(H), std::move(off_diagonal)};
}

template <typename Pose>
class StageProblem : public LeastSquares {
 public:
  StageProblem(const PreparedGraph& prepared,
               std::unique_ptr<ceres::LossFunction> loss,
               StageTerms terms,
               std::vector<TermChunk> chunks,
               Pattern pattern,
               std::shared_ptr<LayoutCache> layouts,
               int threads)
      : LeastSquares(std::move(pattern.H)),
        prepared_(prepared),
        loss_(std::move(loss)),
        terms_(std::move(terms)),
        chunks_(std::move(chunks)),
        off_diagonal_(std::move(pattern.off_diagonal)),
        layouts_(std::move(layouts)),
        threads_(threads) {}

  VectorXd Pack(const State& state) const override { return terms_.variables.Pack(state); }
  void Unpack(const VectorXd& values, State* state) const override {
    terms_.variables.Unpack(values, state);
  }

  bool Retract(const VectorXd& values, const VectorXd& step, VectorXd* moved) const override {
    return dqslam::Retract<Pose>(terms_, values, step, moved);
  }
  bool RetractAlongPath(const VectorXd& values,
                        const VectorXd& step,
                        VectorXd* moved) const override {
    return dqslam::RetractAlongPath<Pose>(prepared_, terms_, values, step, moved);
  }

  bool Cost(const VectorXd& values, double* cost) const override {
    return Add<false>(values, nullptr, cost);
  }

  bool Linearize(const VectorXd& values) override {
    equations_.H.SetZero(threads_);
    equations_.gradient.setZero(equations_.H.rows());
    return Add<true>(values, &equations_, &equations_.cost);
  }
  std::shared_ptr<const Elimination> LayOut() const override {
    return layouts_->EliminationOf(equations_.H.pattern());
  }

 private:
  // Visits all terms: the chunks in parallel, then the others.  The sums over chunks are in their
  // order, whatever the number of threads.  Returns false where a term is undefined.
  template <bool kDerivatives>
  bool Add(const VectorXd& values, NormalEquations* equations, double* cost) const {
    const LinearizedStage stage{prepared_, terms_, loss_.get(), off_diagonal_};
    const UnpackedObjects objects(terms_, values);
    const int num_chunks = static_cast<int>(chunks_.size());
    std::vector<double> costs(num_chunks);
    std::vector<char> defined(num_chunks);
    std::vector<Accumulator> accumulators;
    for (const TermChunk& chunk : chunks_) {
      if (kDerivatives) accumulators.push_back(AccumulatorOf(chunk, equations));
    }
    ParallelFor(threads_, num_chunks, [&](int c) {
      const TermChunk& chunk = chunks_[c];
      Linearizer<Pose, kDerivatives> linearizer(stage,
                                                values,
                                                objects,
                                                chunk.first_pose,
                                                chunk.end_pose,
                                                kDerivatives ? &accumulators[c] : nullptr);
      linearizer.Skip(chunk.odometry.begin);
      bool all = VisitOdometry<Pose>(prepared_, terms_, chunk.odometry, &linearizer);
      linearizer.Skip(terms_.odometry.size() + chunk.boxes.begin);
      all = all && VisitBoxes(terms_, chunk.boxes, &linearizer);
      defined[c] = all;
      costs[c] = linearizer.cost();
    });
    if (std::count(defined.begin(), defined.end(), true) < num_chunks) return false;
    for (Accumulator& accumulator : accumulators) accumulator.AddWaiting();

    std::optional<Accumulator> rest;
    if (kDerivatives) rest.emplace(equations);
    Linearizer<Pose, kDerivatives> linearizer(
        stage, values, objects, 0, 0, rest ? &*rest : nullptr);
    for (const double of_chunk : costs) linearizer.AddCost(of_chunk);
    linearizer.Skip(terms_.odometry.size() + terms_.boxes.size());
    const bool all = VisitOtherTerms<Pose, EllipsoidModel>(prepared_, terms_, &linearizer);
    *cost = linearizer.cost();
    return all && std::isfinite(*cost);
  }

  // It writes to the blocks of the poses of a chunk; a single chunk may write to all blocks.
  Accumulator AccumulatorOf(const TermChunk& chunk, NormalEquations* equations) const {
    if (chunks_.size() == 1) return Accumulator(equations);
    const int first = terms_.variables.first_free_pose;
    return {equations, std::max(chunk.first_pose - first, 0), std::max(chunk.end_pose - first, 0)};
  }

  const PreparedGraph& prepared_;
  const std::unique_ptr<ceres::LossFunction> loss_;
  const StageTerms terms_;
  const std::vector<TermChunk> chunks_;
  const std::vector<int> off_diagonal_;
  const std::shared_ptr<LayoutCache> layouts_;
  const int threads_;
};

}  // namespace

std::unique_ptr<LeastSquares> MakeLeastSquares(const SolveContext& context,
                                               const Stage& stage,
                                               const State& state) {
  StageTerms terms = SelectTerms(context, stage, state);
  return Dispatch(context.graph().pose_model, [&](auto pose) -> std::unique_ptr<LeastSquares> {
    using Pose = decltype(pose);
    std::vector<TermChunk> chunks = SplitTerms(context.graph(), &terms);
    Pattern pattern = MakePattern<Pose>(context, terms);
    return std::make_unique<StageProblem<Pose>>(context.prepared,
                                                MakeLoss(stage.loss, context.options),
                                                std::move(terms),
                                                std::move(chunks),
                                                std::move(pattern),
                                                context.layouts,
                                                context.options.threads);
  });
}

}  // namespace dqslam
