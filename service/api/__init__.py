"""The HTTP service: application, requests, problem documents, the OpenAPI document.

``service.jobs`` runs the jobs; nothing is computed here.
"""
