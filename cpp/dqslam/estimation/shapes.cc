#include "dqslam/estimation/shapes.h"

#include <algorithm>
#include <vector>

#include "dqslam/estimation/graduated.h"
#include "dqslam/estimation/repair.h"
#include "dqslam/estimation/shape_fitter.h"

namespace dqslam {
namespace {

constexpr int kRounds = 8, kPasses = 2;
// Another minimum of all poses and objects must be better by this, in half squared sigmas.
constexpr double kBetter = 0.05;
constexpr int kTrialIterations = 8;

// The stage without the boxes of objects that they do not fit; it has no weights if all fit.
Stage WithoutStuckObjects(const SolveContext& context, const Stage& all, const State& state) {
  Stage others = all;
  others.loss = Loss::kNone;
  others.weights.clear();
  const std::vector<bool> stuck = StuckObjects(context, others, state);
  if (std::none_of(stuck.begin(), stuck.end(), [](bool is_stuck) { return is_stuck; })) {
    return others;
  }
  for (const int row : others.boxes) {
    others.weights.push_back(stuck[context.graph().boxes.object[row]] ? 0 : 1);
  }
  return others;
}

std::vector<Shape> ShapesToTry(Shape wanted) {
  if (wanted != Shape::kAuto) return {wanted};
  return {Shape::kEllipsoid, Shape::kCuboid, Shape::kCylinder};
}

// Minimizes all poses and objects.
void MinimizeAll(const SolveContext& context, Stage stage, State* state, Summary* summary) {
  Append(Optimize(context, stage, state), summary);
  if (summary->converged) return;
  // Where an edge of a body is seen at its end, the dog-leg may step from side to side.
  stage.minimizer = Minimizer::kLevenbergMarquardt;
  Append(Optimize(context, stage, state), summary);
}

// Tries other minima of each body together with all poses and other objects: a body in a wrong
// minimum bends the path, and then fits its boxes better by itself than the right one.  Returns
// whether one was better.
bool TryTogether(const SolveContext& context,
                 const Stage& all,
                 ShapeFitter* fitter,
                 State* state,
                 Summary* summary) {
  Stage trial = all;
  trial.minimizer = Minimizer::kLevenbergMarquardt;
  trial.max_iterations = kTrialIterations;
  trial.function_tolerance = 1e-4;
  const std::vector<bool> stuck = StuckObjects(context, all, *state);
  bool changed = false;
  for (int object = 0; object < context.graph().num_objects(); ++object) {
    if (state->shapes[object] == Shape::kEllipsoid) continue;
    std::vector<ShapeCandidate> candidates = fitter->Alternatives(object);
    if (stuck[object]) {
      const std::vector<ShapeCandidate> fresh = fitter->FreshStarts(object);
      candidates.insert(candidates.end(), fresh.begin(), fresh.end());
    }
    for (const ShapeCandidate& candidate : candidates) {
      const State before = *state;
      Summary total = *summary;
      fitter->Set(object, candidate);
      Append(Optimize(context, trial, state), &total);
      if (total.final_cost < summary->final_cost - kBetter) {
        *summary = total;
        changed = true;
      } else {
        *state = before;
      }
    }
  }
  return changed;
}

}  // namespace

void FitShapes(const SolveContext& context, const Stage& all, State* state, Summary* summary) {
  const Graph& graph = context.graph();
  if (AreEllipsoids(graph.shapes)) return;
  State attempt = *state;
  if (attempt.shapes.empty()) attempt.shapes.assign(graph.num_objects(), Shape::kEllipsoid);
  ShapeFitter fitter(context, all, &attempt);
  Stage last = all;
  bool any = false;
  for (int round = 0; round < kRounds; ++round) {
    bool changed = false;
    for (int object = 0; object < graph.num_objects(); ++object) {
      if (graph.shapes[object] != Shape::kEllipsoid) {
        changed |= fitter.Improve(object, ShapesToTry(graph.shapes[object]));
      }
    }
    if (!changed) break;
    fitter.CountShapes(graph.shapes);
    any = true;
    const bool graduates =
        context.options.loss == Loss::kGncTls || context.options.loss == Loss::kGncGm;
    // An object that is still turned wrongly must not bend the path.
    Stage robust = all;
    robust.weights.clear();
    robust.loss = Loss::kCauchy;
    robust.function_tolerance = 1e-4;
    Append(Optimize(context, robust, &attempt), summary);
    const Stage others = WithoutStuckObjects(context, all, attempt);
    if (!others.weights.empty()) Append(Optimize(context, others, &attempt), summary);
    last = graduates ? InlierStage(context, attempt) : all;
  }
  if (!any) return;
  MinimizeAll(context, last, &attempt, summary);
  for (int pass = 0; pass < kPasses; ++pass) {
    if (!TryTogether(context, last, &fitter, &attempt, summary)) break;
    MinimizeAll(context, last, &attempt, summary);
  }
  *state = attempt;
}

}  // namespace dqslam
