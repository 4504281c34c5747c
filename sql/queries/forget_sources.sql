-- Before rows of these source files are entered again.
DELETE FROM clips USING rows r WHERE clips.dataset = r.dataset AND clips.path = r.path;
DELETE FROM rejects USING rows r WHERE rejects.dataset = r.dataset AND rejects.path = r.path;
DELETE FROM sources USING rows r WHERE sources.dataset = r.dataset AND sources.path = r.path;
