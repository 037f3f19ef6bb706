// A term that does what another says, but to more angles than that one knows.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "estimator/effects/smooth_term.h"

namespace plumbline {

/// Of the head: driver, shape and memory are those of the term that is wrapped.
class WrappedTerm : public SmoothTerm {
 public:
  explicit WrappedTerm(std::unique_ptr<SmoothTerm> term) : term_(std::move(term)) {}

  std::string id() const override { return term_->id(); }
  const std::string& driver() const override { return term_->driver(); }
  TermForm form() const override { return TermForm::geometry; }
  std::string shape() const override { return term_->shape(); }
  Subject subject() const override { return Subject::head; }
  bool remembers() const override { return term_->remembers(); }
  bool guesses_at_start() const override { return term_->guesses_at_start(); }
  std::vector<std::string> columns() const override { return term_->columns(); }

 protected:
  const SmoothTerm& term() const { return *term_; }

 private:
  std::unique_ptr<SmoothTerm> term_;
};

}  // namespace plumbline
