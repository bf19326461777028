// A target has a source file; this one is of the target that headers are precompiled with.
