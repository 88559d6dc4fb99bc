"""What a child left in its scratch folder, checked and stored by the service process.

A child that reads strangers' files may have been taken over: it names no stored file, and nothing
that it wrote is used before it is checked.
"""

from __future__ import annotations

import shutil
from pathlib import Path

from pydantic import ValidationError

from service.outbound import CachedFile, HttpCache, Validators
from service.schemas.inlier_file import read_inliers
from service.schemas.result import Result
from service.schemas.serialize_result import count_pairs, split_pairs
from service.storage.blobs import Blob, BlobStore
from service.storage.plain_file import NotPlainFileError, is_plain_file, open_plain_file
from service.workers.child import ChildLostError
from service.workers.messages import FetchedFile
from service.workers.register_clouds import INLIERS_NAME, RESULT_NAME

MAX_RESULT_BYTES = 4 << 20
"""Length of a result document; one with MAX_INLINE_PAIRS has 1.4 MB, or 2.4 MB where the clouds
have billions of points."""


def store_result(scratch: Path, blobs: BlobStore) -> tuple[Blob, Blob]:
    """Copy the result and the inlier pairs of a registration to the blob store.

    Raises
    ------
    ChildLostError
        A file is missing or not valid.
    """
    try:
        with open_plain_file(scratch / RESULT_NAME) as file:
            content = file.read(MAX_RESULT_BYTES + 1)
        document, pairs = split_pairs(content[:MAX_RESULT_BYTES])
        result = Result.model_validate_json(document)
        is_complete = not pairs or count_pairs(pairs) == result.inliers.count
        inliers = _copy(scratch / INLIERS_NAME, blobs)
        count = len(read_inliers(blobs.path(inliers.sha256)))
    except (NotPlainFileError, ValidationError, ValueError) as error:
        raise ChildLostError("its result is missing or not valid") from error
    if not (is_complete and count == result.inliers.count):
        raise ChildLostError("its inlier pairs are not those of its result")
    return blobs.put([content]), inliers


def store_fetched(
    file: FetchedFile, path: Path, blobs: BlobStore, cache: HttpCache, *, max_bytes: int
) -> Blob:
    """Move a fetched file to the blob store, or find the cached one that is still current.

    Raises
    ------
    ChildLostError
        The file is missing or too long.
    """
    if file.is_cached:
        cached = cache.find(file.key)
        if cached is None:
            raise ChildLostError("the cached file was removed before it was used")
        return cached.blob
    if not is_plain_file(path) or path.stat().st_size > max_bytes:
        raise ChildLostError("the file that it fetched is missing or too long")
    blob = blobs.adopt(path)
    cache.store(file.key, CachedFile(blob, Validators(file.etag, file.last_modified)))
    return blob


def _copy(path: Path, blobs: BlobStore) -> Blob:
    with open_plain_file(path) as file, blobs.writer() as writer:
        shutil.copyfileobj(file, writer, 1 << 20)
        return writer.commit()
